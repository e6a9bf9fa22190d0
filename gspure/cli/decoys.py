"""``gspure decoys``: pictures of random rooms, for `gspure retrieve`."""

from gspure.cli.options import add_quiet
from gspure.cli.parser import Arguments, Parser
from gspure.progress import track
from gspure.settings import TRACED_SIDE, VIEWS

EXAMPLES = """\
  gspure decoys --views 4 --width 160 --height 120 --out decoys

Writes a folder of pictures for each room, with coarser lighting than `gspure pair`.
"""

COARSENESS = 2  # of the light (`gspure.scenes.lighting.bake`); ours


def add_arguments(parser: Parser) -> None:
    parser.number("--views", "N", "views of each room", VIEWS, 4)
    parser.number("--width", "PX", "image width; use that of the message's images", TRACED_SIDE, 160)
    parser.number("--height", "PX", "image height; use that of the message's images", TRACED_SIDE, 120)
    parser.writes("--out", "DIR", "pictures, in folders SEED")
    add_quiet(parser)


def run(args: Arguments) -> None:
    """Write the pictures, all of them or none."""
    from gspure.artifacts import filling
    from gspure.scenes.lighting import bake
    from gspure.scenes.photography import path_cameras, picture
    from gspure.scenes.placement import PLACEMENTS
    from gspure.scenes.procedural import DECOYS, Interior

    views = path_cameras(args.views, args.width, args.height)
    names = [f"{seed}/{name}" for seed in DECOYS for name in (f"{view.name}.png" for view in views)]
    with filling(args.out, *names) as folder:
        for seed in track(DECOYS, "decoys"):
            lit = bake(Interior(seed)(PLACEMENTS["coincident"]), coarseness=COARSENESS)
            picture(lit, views, folder / str(seed))
