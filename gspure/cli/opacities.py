"""``gspure opacities``: the opacity of every row, for clustering and attacks."""

from gspure.cli.options import add_quiet, add_scheme, add_views, read_views
from gspure.cli.parser import Arguments, Parser

EXAMPLES = """\
  gspure opacities --model point_cloud.ply --cameras cameras.json --out opacities.npy
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--model", "MODEL", "the model's file")
    add_scheme(parser)
    add_views(parser, split="train")
    parser.writes("--out", "NPY", "opacities: float32 [K]")
    add_quiet(parser)


def run(args: Arguments) -> None:
    from gspure.artifacts import save_array, write_record
    from gspure.cameras import views_digest
    from gspure.model import model_file
    from gspure.schemes.registry import geometry_of, read_public_model

    public, views = read_public_model(args.model, args.scheme), read_views(args)
    save_array(args.out, public.drawable(args.model).opacities(views))
    inputs, geometry = {"model": model_file(args.model), "cameras": args.cameras}, geometry_of(args.model)
    ancestors = {} if public.rows_are_gaussians else {"views": views_digest(views)}  # those of Gaussians are stored
    settings = {"split": args.split}
    write_record(args.out, inputs=inputs, settings=settings, geometry=geometry, kind="opacities", ancestors=ancestors)
