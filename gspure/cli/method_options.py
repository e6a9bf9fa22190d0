"""Options of the method that several commands share: clustering and pruning."""

from __future__ import annotations

import argparse

from gspure.clustering.selection import SELECTIONS
from gspure.constants import MAX_CLUSTER_SHARE, MIN_CLUSTER_SIZE, MIN_SAMPLES, TAU_C, TAU_N
from gspure.weights import REDUCTIONS


def add_reduction(parser: argparse.ArgumentParser) -> None:
    """Add ``--reduction``."""
    parser.add_argument(
        "--reduction",
        choices=REDUCTIONS,
        default="sum",
        help="how the pixels of a view become one contribution (default: %(default)s)",
    )


def add_min_samples(parser: argparse.ArgumentParser) -> None:
    """Add ``--min-samples``."""
    parser.add_argument(
        "--min-samples", type=int, default=MIN_SAMPLES, metavar="N", help="HDBSCAN's min_samples (default: %(default)s)"
    )


def add_selection(parser: argparse.ArgumentParser) -> None:
    """Add ``--min-cluster-size``, ``--selection`` and ``--max-cluster-share``."""
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
        help="excess of mass without clusters above --max-cluster-share, plain excess of mass, or the leaves of the "
        "hierarchy (default: %(default)s)",
    )
    parser.add_argument(
        "--max-cluster-share",
        type=float,
        default=MAX_CLUSTER_SHARE,
        metavar="SHARE",
        help="for eom_capped: largest share of the Gaussians in one cluster (default: %(default)s)",
    )


def add_factors(parser: argparse.ArgumentParser) -> None:
    """Add ``--tau-c`` and ``--tau-n``."""
    parser.add_argument(
        "--tau-c",
        type=float,
        default=TAU_C,
        metavar="TAU",
        help="prune a cluster whose mean weight is below the mean weight / TAU (default: %(default)s)",
    )
    parser.add_argument(
        "--tau-n",
        type=float,
        default=TAU_N,
        metavar="TAU",
        help="prune a noise point whose weight is below the mean weight / TAU (default: %(default)s)",
    )
