"""``gspure tree``: HDBSCAN's minimum spanning tree."""

import numpy as np

from gspure.artifacts import load_array, save_array, write_record
from gspure.cli.method_options import add_min_samples
from gspure.cli.parser import Arguments, Parser
from gspure.method.features import COLUMNS, PARTS, take
from gspure.method.tree import spanning_tree

EXAMPLES = """\
  gspure tree --features features.npy --out tree.npy
  gspure tree --features features.npy --min-samples 20 --out tree_20.npy
  gspure tree --features features.npy --cluster-on position weight --out tree_without_opacity.npy
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--features", "NPY", "of `gspure features`")
    parser.add_argument(
        "--cluster-on",
        nargs="+",
        choices=tuple(PARTS),
        default=list(PARTS),
        metavar="PART",
        help="the features of the clustering: position, opacity, weight (default: all)",
    )
    add_min_samples(parser)
    parser.writes("--out", "NPY", "edges: float64 [K-1,3], by distance")


def run(args: Arguments) -> None:
    features = load_array(args.features, dtype=np.float64, shape=(None, len(COLUMNS)))
    save_array(args.out, spanning_tree(take(features, args.cluster_on), args.min_samples))
    settings = {"cluster_on": args.cluster_on, "min_samples": args.min_samples}
    write_record(args.out, inputs={"features": args.features}, settings=settings)
