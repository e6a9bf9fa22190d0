"""``gspure render``: images of a model."""

from gspure.cli.options import (
    add_background,
    add_device,
    add_energy,
    add_scheme,
    add_views,
    read_background,
    read_device,
    read_public,
    read_views,
    record_command,
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
    parser.writes("--out", "DIR", "folder for VIEW.png")
    parser.flag("--npy", "also write VIEW.npy: float32 [H,W,3], not clipped")
    add_background(parser, "the model", "MODEL")
    add_energy(parser, "ewa", "ray")
    add_device(parser)


def run(args: Arguments) -> None:
    """Render every view."""
    from gspure.files import filling, save_array
    from gspure.images import is_flat, write_image

    views, public = read_views(args), read_public(args)
    args.background = read_background(args, public.model.background)
    scene = public.scene(read_device(args), args.background, args.energy)
    empty = []
    with filling(args.out) as folder:
        for camera in track(views, "render"):
            image = scene(camera)
            empty += [camera.name] * is_flat(image)
            write_image(folder / f"{camera.name}.png", image)
            if args.npy:
                save_array(folder / f"{camera.name}.npy", image)
        if isinstance(args.cameras, str):
            write_views(folder, views)
        record_command(args, folder)
    if empty:
        count = f"{len(empty)} of {len(views)} views"
        warn(f"{count} show a single colour (first: {empty[0]}): do cameras and model belong together?")
