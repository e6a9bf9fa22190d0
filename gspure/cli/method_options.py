"""Options of the method that several commands share."""

from __future__ import annotations

import argparse

from gspure.constants import MIN_SAMPLES, TAU_C, TAU_N


def add_min_samples(parser: argparse.ArgumentParser) -> None:
    """Add ``--min-samples``."""
    parser.add_argument(
        "--min-samples", type=int, default=MIN_SAMPLES, metavar="N", help="HDBSCAN's min_samples (default: %(default)s)"
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
