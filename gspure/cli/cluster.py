"""``gspure cluster``: flat clusters from a spanning tree."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.cli.outputs import Output
from gspure.constants import MAX_CLUSTER_SHARE, MIN_CLUSTER_SIZE

HELP = "select clusters from a spanning tree"
EXAMPLES = """\
  gspure cluster --tree tree.npy --out clusters.npz
  gspure cluster --tree tree.npy --selection leaf --min-cluster-size 100 --out leaves.npz
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("--tree", type=Path, required=True, metavar="NPY", help="tree, from `gspure tree`")
    add_selection(parser)
    parser.add_argument("--out", type=Output, required=True, metavar="NPZ", help="labels: int32 [K], -1 is noise")


def run(args: argparse.Namespace) -> None:
    """Select and write the clusters."""
    from gspure.artifacts import write_provenance
    from gspure.method.clustering.selection import select
    from gspure.method.clustering.store import Clusters, read_tree, write_clusters
    from gspure.method.clustering.tree import coincident_points

    tree = read_tree(args.tree)
    settings = {name: getattr(args, name) for name in ("min_cluster_size", "selection", "max_cluster_share")}
    write_clusters(args.out, Clusters(select(tree, **settings), coincident_points(tree)), settings)
    write_provenance(args.out, inputs={"tree": args.tree}, settings=settings)


def add_selection(parser: argparse.ArgumentParser) -> None:
    """Add ``--min-cluster-size``, ``--selection`` and ``--max-cluster-share``."""
    from gspure.method.clustering.selection import SELECTIONS

    parser.add_argument(
        "--min-cluster-size",
        type=int,
        default=MIN_CLUSTER_SIZE,
        metavar="N",
        help="HDBSCAN's min_cluster_size (default: %(default)s)",
    )
    parser.add_argument(
        "--selection",
        choices=SELECTIONS,
        default=SELECTIONS[0],
        help="eom_capped, eom: HDBSCAN's excess of mass with and without --max-cluster-share; leaf: the leaves "
        "of its hierarchy (default: %(default)s)",
    )
    parser.add_argument(
        "--max-cluster-share",
        type=float,
        default=MAX_CLUSTER_SHARE,
        metavar="SHARE",
        help="for eom_capped: largest share of the Gaussians in one cluster (default: %(default)s)",
    )
