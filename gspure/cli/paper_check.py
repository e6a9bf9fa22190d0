"""``gspure paper-check``: the paper's printed numbers against what follows from its own tables."""

from __future__ import annotations

import argparse
import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gspure.evaluation.paper import Cell, Check

HELP = "compare the paper's printed numbers with what follows from its tables"
EXAMPLES = """\
  gspure paper-check
  gspure paper-check --out paper.csv     # one row per number
"""

HEADER = (
    *("place", "words", "quantity", "scheme", "variant", "target", "relation", "printed"),
    *("recomputed", "difference", "holds", "agrees_with"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("--out", type=Path, metavar="CSV", help="write the numbers as a table too")


def run(args: argparse.Namespace) -> None:
    """Print every check, then what else does not fit."""
    from gspure.evaluation.paper import check_claims, find_oddities, read_cells
    from gspure.evaluation.paper.checks import ROUNDING

    cells = read_cells()
    checks = check_claims(cells)
    failed = sum(not check.holds for check in checks)
    print("Scores in dB: printed, recomputed from Table 1 with the 95 % interval over its scenes, difference")
    print("\n".join(_score_line(check, cells) for check in checks if check.claim.quantity == "score"))
    print("\nother numbers in dB: printed, recomputed from Table 1, difference")
    print("\n".join(_line(check) for check in checks if check.claim.quantity != "score"))
    print("\nnot as the text or the captions say")
    print("\n".join(f"  {sentence}" for sentence in find_oddities(cells)))
    print(f"\n{failed} of {len(checks)} numbers do not follow from Table 1 within {ROUNDING} dB")
    if args.out:
        _write(args.out, checks)


def _score_line(check: Check, cells: Sequence[Cell]) -> str:
    from gspure.evaluation.paper import score_interval

    interval = score_interval(cells, check.claim.scheme, check.claim.variant)
    numbers = f"{check.claim.value:7.2f}  {interval!s:<23}{_rounded(check.difference):+6.2f}"
    return f"  {check.claim.scheme:<18}{check.claim.variant:<17}{numbers}{_verdict(check)}"


def _line(check: Check) -> str:
    bound = "<" if check.claim.relation == "<" else " "
    numbers = f"{bound}{check.claim.value:6.2f}  {check.recomputed:6.2f}  {_rounded(check.difference):+6.2f}"
    return f"  {numbers}  {check.claim.place}: {check.claim.words}{_verdict(check)}"


def _rounded(difference: float) -> float:
    return round(difference, 2) + 0.0  # no -0.00


def _verdict(check: Check) -> str:
    if check.holds:
        return ""
    return f"  DIFFERS, agrees with {check.agrees_with}" if check.agrees_with else "  DIFFERS"


def _write(path: Path, checks: Sequence[Check]) -> None:
    from gspure.artifacts import write_text

    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(HEADER)
    for check in checks:
        numbers = (f"{check.claim.value:.2f}", f"{check.recomputed:.4f}", f"{check.difference:.4f}")
        table.writerow([*check.claim[:-1], *numbers, check.holds, check.agrees_with])
    write_text(path, text.getvalue())
