"""``gspure tree``: the spanning tree that all of HDBSCAN's clusterings come from."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.cli.method_options import add_min_samples

HELP = "compute HDBSCAN's minimum spanning tree, which depends on min_samples only"
EXAMPLES = """\
  gspure tree --features features.npy --out tree.npy
  gspure tree --features features.npy --min-samples 20 --out tree_20.npy
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("--features", type=Path, required=True, metavar="NPY", help="of `gspure features`")
    add_min_samples(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="NPY", help="edges: float64 [K-1,3], by distance")


def run(args: argparse.Namespace) -> None:
    """Compute and write the tree."""
    import numpy as np

    from gspure.artifacts import load_array, save_array, write_provenance
    from gspure.clustering.tree import spanning_tree

    features = load_array(args.features, dtype=np.float64, shape=(None, None))
    save_array(args.out, spanning_tree(features, args.min_samples))
    write_provenance(args.out, inputs={"features": args.features}, settings={"min_samples": args.min_samples})
