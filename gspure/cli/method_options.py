"""Options of clustering and pruning; not in `options`, which imports the renderer, so that its edits rerun neither."""

from gspure.cli.parser import Parser
from gspure.constants import ANCHOR_TAU_C, ANCHOR_TAU_N, MIN_SAMPLES, TAU_C, TAU_N
from gspure.settings import FACTOR, NEIGHBOURS


def add_min_samples(parser: Parser) -> None:
    """Add ``--min-samples``."""
    parser.number("--min-samples", "N", "HDBSCAN's min_samples", NEIGHBOURS, MIN_SAMPLES)


def add_factors(parser: Parser, *, by_scheme: bool = False) -> None:
    """Add ``--tau-c`` and ``--tau-n``; with `by_scheme`, the default depends on the model and is None here."""
    for name, value, anchors, pruned in (
        ("--tau-c", TAU_C, ANCHOR_TAU_C, "clusters whose mean weight"),
        ("--tau-n", TAU_N, ANCHOR_TAU_N, "noise points whose weight"),
    ):
        known = f" (default: {value}; anchors: {anchors})" if by_scheme else ""
        meaning = f"prune {pruned} is below the mean weight of all rows / TAU{known}"
        parser.number(name, "TAU", meaning, FACTOR, None if by_scheme else value)
