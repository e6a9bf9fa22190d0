"""``gspure opacities``: the opacity of every row, for clustering and attacks."""

from gspure.cli.options import add_scheme, add_views, read_public, read_views
from gspure.cli.parser import Arguments, Parser

EXAMPLES = """\
  gspure opacities --model point_cloud.ply --cameras cameras.json --out opacities.npy
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--model", "MODEL", "the model's file")
    add_scheme(parser)
    add_views(parser, split="train")
    parser.writes("--out", "NPY", "opacities: float32 [K]")


def run(args: Arguments) -> None:
    from gspure.artifacts import save_array, write_record
    from gspure.model import read_model

    public = read_public(args)
    save_array(args.out, public.opacities(read_views(args)))
    inputs, geometry = {"model": args.model, "cameras": args.cameras}, read_model(args.model).geometry_digest()
    write_record(args.out, inputs=inputs, settings={"split": args.split}, geometry=geometry, kind="opacities")
