"""``gspure weights``: the average contribution of every Gaussian over the views."""

from gspure.cli.parser import Arguments, Parser
from gspure.progress import warn
from gspure.settings import VIEWS

EXAMPLES = """\
  gspure weights --index room.tsv --model point_cloud.ply --out weights.npy
  gspure weights --index room.tsv --model point_cloud.ply --views 4 --out omega_4.npy
  gspure weights --index 1.tsv 2.tsv --model point_cloud.ply --reduction max --out omega_max.npy
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--index", "TSV", "indices, from `gspure contributions`", nargs="+")
    parser.reads("--model", "MODEL", "the model of these contributions")
    add_reduction(parser)
    parser.number("--views", "N", "average over N views only, evenly spread by name (default: all)", VIEWS)
    parser.writes("--out", "NPY", "weights: float32 [K]")


def run(args: Arguments) -> None:
    """Read the stages of all parts in the order of their views, and average them."""
    import numpy as np

    from gspure.artifacts import save_array, settings_of, write_record
    from gspure.method.contributions import read_contributions, read_index
    from gspure.method.weights import accumulate, evenly_spread, few_in_view, require_in_view
    from gspure.model import model_file
    from gspure.schemes.registry import read_public_model

    public = read_public_model(args.model)
    count, geometry = len(public.model), public.geometry_digest()
    stages = read_index(*args.index)
    if args.views is not None:
        stages = evenly_spread(stages, args.views)
    weights = accumulate((read_contributions(stage.path, count) for stage in stages), count, args.reduction)
    require_in_view(weights)
    save_array(args.out, weights)
    inputs = {"model": model_file(args.model)} | {f"index {i}": path for i, path in enumerate(args.index, start=1)}
    measured = {name: value for name, value in settings_of(args.index[0]).items() if name in {"energy", "split"}}
    settings = {**measured, "reduction": args.reduction, "views": len(stages)}
    write_record(args.out, inputs=inputs, settings=settings, geometry=geometry, kind="weights")
    for sentence in few_in_view(int(np.count_nonzero(weights)), len(weights)):
        warn(f"{sentence}")


def add_reduction(parser: Parser) -> None:
    """Add ``--reduction``."""
    from gspure.method.weights import REDUCTIONS

    parser.choice("--reduction", REDUCTIONS, "how the pixels of a view become one contribution", "sum")
