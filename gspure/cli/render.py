"""``gspure render``: images of a model."""

from gspure.cli.options import (
    add_background,
    add_device,
    add_energy,
    add_off_path,
    add_scheme,
    add_views,
    read_background,
    read_device,
    read_public,
    read_views,
    unmoved,
    write_views,
)
from gspure.cli.parser import Arguments, Parser
from gspure.progress import track, warn

EXAMPLES = """\
  gspure render point_cloud.ply --cameras cameras.json --out renders
  gspure render point_cloud.ply --cameras orbit --out renders             # generated views, in renders/cameras.json
  gspure render point_cloud.ply --cameras cameras.json --out renders --split test --npy --background 1 1 1
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("model", "MODEL", "the model's file, or the output folder of a training run")
    add_scheme(parser)
    add_views(parser, split="all")
    add_off_path(parser)
    parser.writes("--out", "DIR", "folder for VIEW.png; it must not hold other images")
    parser.flag("--npy", "also write VIEW.npy: float32 [H,W,3], not clipped")
    add_background(parser, "the model", "MODEL")
    add_energy(parser, "ewa", "ray")
    add_device(parser)


def run(args: Arguments) -> None:
    """Render every view."""
    from gspure.artifacts import (
        RENDERED,
        embedding_of,
        facts_of,
        filling,
        known_digest,
        remove,
        save_array,
    )
    from gspure.evaluation.origins import attacks_of
    from gspure.evaluation.outcomes import SCENE
    from gspure.images import is_flat, record_views, require_no_other_images, write_image
    from gspure.model import model_file

    views = read_views(args)
    require_no_other_images(args.out, (camera.name for camera in views))
    public = read_public(args)
    background = read_background(args, public.model.background)
    scene = public.scene(read_device(args), background, args.energy)
    names = [f"{camera.name}.{kind}" for camera in views for kind in ("png", "npy")[: 1 + args.npy]]
    with filling(args.out, *names, RENDERED, *["cameras.json"] * isinstance(args.cameras, str)) as folder:
        empty = []
        for camera in track(views, "render"):
            image = scene(camera)
            if is_flat(image):
                empty.append(camera.name)
            write_image(folder / f"{camera.name}.png", image)
            if args.npy:
                save_array(folder / f"{camera.name}.npy", image, checksum=True)
        file = model_file(args.model)
        origin = {"target": SCENE, "model": known_digest(file), "embedding": embedding_of(file)}
        origin["attack"] = attacks_of(file)
        origin["photographs"] = facts_of(file).get(SCENE, "")
        record_views(folder, unmoved(args, views), background, args.energy, **origin)
        if isinstance(args.cameras, str):
            write_views(args, folder, views)
    if empty:
        count = f"{len(empty)} of {len(views)} views"
        warn(f"{count} show a single colour (first: {empty[0]}): do cameras and model belong together?")
    if not args.npy:  # of an earlier run
        remove(*(args.out / f"{camera.name}.npy" for camera in views))
