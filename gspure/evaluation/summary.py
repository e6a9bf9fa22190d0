"""Outcomes averaged over scenes: one row per scheme, variant and extraction, as in the paper's Table 1."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final, NamedTuple

from gspure.evaluation.outcomes import MESSAGE, SCENE, Outcome, ordered
from gspure.evaluation.paper import read_cells
from gspure.evaluation.paper.cells import TARGETS
from gspure.evaluation.paper.quantities import ablations, printed_scores, table_1
from gspure.evaluation.sheet import Cell, write_sheet
from gspure.evaluation.statistics import Interval, known_interval

PAPER: Final = ("scene", "message", "score")
QUANTITIES: Final = (*PAPER, *(f"off_path_{name}" for name in PAPER))


class Summary(NamedTuple):
    """One variant of one scheme over all scenes; what no scene knows is None."""

    scheme: str
    variant: str
    extraction: str
    """The target that shows the message: ``message``, or another way of extracting it."""

    scene: Interval | None
    """PSNR of the scene, dB."""

    message: Interval | None
    """PSNR of the message, dB."""

    score: Interval | None

    off_path: tuple[Interval | None, Interval | None, Interval | None]
    """The same three from views beside the path of the cameras."""

    paper: float
    """The Score that the paper prints for this scheme and variant, of its own scenes; NaN if it prints none."""

    paper_scene: float = math.nan
    paper_message: float = math.nan
    """The PSNR of scene and message that it prints, means over its own scenes, dB (Tables 1 to 3)."""


def summarize(outcomes: Sequence[Outcome]) -> list[Summary]:
    """Average over scenes and their seeds; schemes and variants stay in the order of `outcomes`, sorted by scheme.

    A number counts where it is known: a scene without it is missing from that mean, as the interval's count tells.
    """
    cells = read_cells()
    printed, psnr = printed_scores(cells), ablations(cells) | table_1(cells)
    found = []
    for scheme, group in groupby(outcomes, key=lambda o: o.scheme):
        ours = list(group)
        extractions = ordered({target for o in ours for target in o.messages}) or [MESSAGE]
        for variant in dict.fromkeys(o.variant for o in ours):
            scenes = [o for o in ours if o.variant == variant]
            paper = printed.get((scheme, variant), math.nan)
            means = [psnr.get((scheme, variant, target), math.nan) for target in TARGETS]
            found += [_row(scenes, extraction, paper, *means) for extraction in extractions]
    return found


def write_summary(path: Path, rows: Iterable[Summary]) -> None:
    """Write one CSV row per summary; unknown numbers are empty.

    ``level`` is 0.95 for a bootstrap interval over scenes; less where scenes are so few that ``low`` and ``high`` are
    their smallest and largest value.
    """
    columns = [f"{name}_{part}" for name in QUANTITIES for part in Interval._fields]
    header = ["scheme", "variant", "extraction", *columns, *(f"paper_{name}" for name in PAPER)]
    write_sheet(path, header, map(_cells, rows))


def _cells(row: Summary) -> Iterator[Cell]:
    yield from (row.scheme, row.variant, row.extraction)
    for interval in (row.scene, row.message, row.score, *row.off_path):
        yield from interval or (None,) * len(Interval._fields)
    yield from (row.paper_scene, row.paper_message, row.paper)


def _row(scenes: Sequence[Outcome], extraction: str, *paper: float) -> Summary:
    aside = _means([o.aside() for o in scenes], extraction)
    return Summary(scenes[0].scheme, scenes[0].variant, extraction, *_means(scenes, extraction), aside, *paper)


def _means(scenes: Sequence[Outcome], extraction: str) -> tuple[Interval | None, Interval | None, Interval | None]:
    """Return the means of the scene's PSNR, the message's and the Score."""
    scene, message = (
        known_interval({(o.scene, o.seed): o.targets[target].psnr for o in scenes if target in o.targets})
        for target in (SCENE, extraction)
    )
    return scene, message, known_interval({(o.scene, o.seed): o.score_of(extraction) for o in scenes})
