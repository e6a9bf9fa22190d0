"""The main table in LaTeX: schemes and attacks by rows, as the paper's Table 1, with intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Final

from gspure.evaluation.outcomes import MESSAGE
from gspure.evaluation.statistics import LEVEL, Interval
from gspure.evaluation.summary import Summary

SPECIAL: Final = str.maketrans(
    {
        **{character: f"\\{character}" for character in "&%$#_{}"},
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
    }
)

UNKNOWN: Final = "--"

HEAD: Final = r"""% Needs \usepackage{booktabs}.
% PSNR in dB, mean over scenes. Score = (drop of the message's PSNR) - (drop of the scene's PSNR).
% Brackets: 95 % bootstrap interval over scenes. Parentheses: smallest and largest of fewer than six scenes.
% The last column is what the paper prints, of its own scenes.
\begin{tabular}{llrrrlr}
\toprule
Scheme & Attack & Scenes & Scene & Message & Score & Score [paper] \\"""


def latex(rows: Sequence[Summary]) -> str:
    """Return a booktabs table, one block per scheme.

    Parameters
    ----------
    rows : sequence of Summary
        Sorted by scheme (`gspure.evaluation.summary.summarize`).

    """
    lines = [HEAD]
    for scheme, group in groupby(rows, key=lambda row: row.scheme):
        first, *others = group
        lines += [r"\midrule", _line([escaped(scheme), *_cells(first)])]
        lines += [_line(["", *_cells(row)]) for row in others]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def escaped(text: str) -> str:
    """Return text in which no character means anything to LaTeX."""
    return text.translate(SPECIAL)


def _cells(row: Summary) -> Iterable[str]:
    extraction = "" if row.extraction == MESSAGE else f" ({row.extraction})"
    scenes = max(interval.scenes if interval else 0 for interval in (row.scene, row.message, row.score))
    yield escaped(row.variant + extraction)
    yield f"{scenes}"
    yield _number(row.scene.mean) if row.scene else UNKNOWN
    yield _number(row.message.mean) if row.message else UNKNOWN
    yield _with_bounds(row.score) if row.score else UNKNOWN
    yield UNKNOWN if math.isnan(row.paper) else _number(row.paper)


def _with_bounds(interval: Interval) -> str:
    if interval.scenes == 1:
        return _number(interval.mean)
    left, right = ("[", "]") if interval.level >= LEVEL else ("(", ")")
    return f"{_number(interval.mean)} ${left}{interval.low:.2f},\\ {interval.high:.2f}{right}$"


def _number(value: float) -> str:
    return f"${value:.2f}$"  # in math mode the sign is a minus, not a hyphen


def _line(cells: Iterable[str]) -> str:
    return " & ".join(cells) + r" \\"
