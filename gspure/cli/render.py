"""``gspure render``: images of a model."""

from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.progress import track, warn

EXAMPLES = """\
  gspure render point_cloud.ply --cameras orbit --out renders             # generated views, in renders/cameras.json
  gspure render point_cloud.ply --cameras cameras.json --out renders --split test --npy --background 1 1 1
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("model", "MODEL", "the model's file, or the output folder of a training run")
    parser.text(*options.SCHEME)
    options.add_views(parser, split="all")
    parser.writes("--out", "DIR", "folder for VIEW.png")
    parser.flag("--npy", "also write VIEW.npy: float32 [H,W,3], not clipped")
    options.add_background(parser, "the model", "MODEL")
    options.add_energy(parser, "ewa", "ray")
    options.add_device(parser)


def run(args: Arguments) -> None:
    """Render every view."""
    from gspure.arrays import save_array
    from gspure.figures.panels import mention_up
    from gspure.files import filling_alone
    from gspure.images import is_flat, write_image
    from gspure.schemes.registry import read_public_model

    views = options.read_views(args, args.split, args.transform)
    public = read_public_model(args.model, args.scheme).drawable(args.model)
    background = tuple(args.background or public.model.background)
    scene = public.scene(options.read_device(args), background, args.energy)
    empty = []
    with filling_alone(args.out) as folder:
        for camera in track(views, "render"):
            image = scene(camera)
            if is_flat(image):
                empty.append(camera.name)
            write_image(folder / f"{camera.name}.png", image)
            if args.npy:
                save_array(folder / f"{camera.name}.npy", image)
        if isinstance(args.cameras, str):
            options.write_views(folder, views)
        options.record_command(args, folder, resolved={"background": background})
    if isinstance(args.cameras, str):
        mention_up(public.model, scene, args.up, args.out)
    if empty:
        count = f"{len(empty)} of {len(views)} views"
        warn(f"{count} show a single colour (first: {empty[0]}): do cameras and model belong together?")
