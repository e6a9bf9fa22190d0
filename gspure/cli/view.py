"""``gspure view``: a page with a model in 3-D, or two side by side."""

from pathlib import Path

from gspure.cli.options import add_cameras, read_source
from gspure.cli.parser import Arguments, Parser

EXAMPLES = """\
  gspure view point_cloud.ply                                  # view.html, which works from disk
  gspure view point_cloud.ply purified/purified.ply --out compared.html
  gspure view marked/public --cameras pair              # a room, as seen from inside
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("model", "MODEL", "file of a 3DGS model, or folder of a training run, with its cameras")
    parser.reads("other", "OTHER", "another model, in the same world: a draggable divider separates both", nargs="?")
    add_cameras(parser, "views to begin from", more=" (default: those beside MODEL)", required=False)
    parser.writes("--out", "HTML", "page to write, or to replace", default=Path("view.html"))


def run(args: Arguments) -> None:
    """Write the page."""
    from gspure.cameras.reading import default_cameras
    from gspure.schemes.registry import read_public_model
    from gspure.viewer.view import view_beside

    files = [file for file in (args.model, args.other) if file]
    source = args.cameras or default_cameras(args.model)
    has_views = args.cameras or isinstance(source, Path)
    cameras = read_source(source, args.model, up=args.up) if has_views else []
    models = {str(file): read_public_model(file).drawable(file) for file in files}
    view_beside(models, cameras).write(args.out)
    print(args.out)
