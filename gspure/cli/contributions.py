"""``gspure contributions``: the contribution of every Gaussian to every view."""

import argparse

from gspure.cli.options import add_device, add_energy, add_scheme, add_views, read_device, read_views
from gspure.cli.parser import Arguments, Parser
from gspure.progress import say
from gspure.settings import VIEWS

EXAMPLES = """\
  gspure contributions --model point_cloud.ply --cameras cameras.json --stages stages/room --index room.tsv
  gspure contributions --model point_cloud.ply --cameras cameras.json --stages stages/room --part 1/2 --index 1.tsv
  gspure contributions --model point_cloud.ply --cameras cameras.json --stages stages/room --part 2/2 --index 2.tsv
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--model", "MODEL", "the model's file")
    add_scheme(parser)
    add_views(parser, split="train")
    parser.reads("--stages", "DIR", "folder of the stage files")
    parser.add_argument(
        "--part",
        type=_part,
        default=(1, 1),
        metavar="I/N",
        help="compute a part of the views, for parallel jobs: view I and every N-th after it, by name",
    )
    parser.writes("--index", "TSV", "index of the views and their files")
    add_energy(parser, "ray", "ewa", "center_ray")
    add_device(parser)


def run(args: Arguments) -> None:
    from gspure.artifacts import write_record
    from gspure.cameras import views_digest
    from gspure.method.contributions import contribute, write_index
    from gspure.model import model_file
    from gspure.model.suspicious import lines, suspicious_rows
    from gspure.schemes.registry import geometry_of, read_public_model

    part, parts = args.part
    views = read_views(args)
    stored = read_public_model(args.model, args.scheme)
    public, geometry = stored.drawable(args.model), geometry_of(args.model)
    for line in lines(suspicious_rows(stored.model), len(stored.model)):
        say(line)
    device = read_device(args)
    stages = contribute(public, views[part - 1 :: parts], args.stages, device=device, energy=args.energy)
    write_index(args.index, stages)
    settings = {"energy": args.energy, "split": args.split, "part": f"{part}/{parts}"}
    inputs, ancestors = {"model": model_file(args.model), "cameras": args.cameras}, {"views": views_digest(views)}
    write_record(args.index, inputs=inputs, settings=settings, geometry=geometry, ancestors=ancestors)


def _part(text: str) -> tuple[int, int]:
    part, _, parts = text.partition("/")
    first, count = VIEWS.parse(part), VIEWS.parse(parts)
    if first is None or count is None or first > count:
        raise argparse.ArgumentTypeError(f"expected I/N with 1 <= I <= N <= {VIEWS.most}, found {text!r}")
    return int(first), int(count)
