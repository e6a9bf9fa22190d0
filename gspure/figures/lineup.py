"""Scene and message after every attack, side by side, as in the paper's qualitative comparison (Fig. 3)."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from gspure.evaluation.metrics import METRICS, psnr
from gspure.evaluation.names import GSPURE, display_name
from gspure.evaluation.outcomes import Outcome
from gspure.figures import style
from gspure.figures.panels import Image, show

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS: Final = 6  # most columns in a block, so that their titles are legible on a page

_TITLE: Final = 0.26  # height of a block's titles, inches: two lines
_TITLE_WIDTH: Final = 16  # letters in a line of them
_LABEL: Final = 0.15  # height of a tile's label
_NAMES: Final = 0.16  # breadth of the rows' names
_PADDING: Final = 0.04  # beside each tile
_GAP: Final = 0.15  # between blocks
_WORDS: Final = 30  # letters in a line of a reason
_LINES: Final = 6  # and its lines


@dataclass(frozen=True)
class Column:
    """The images [H,W,3] of one variant, or of the reference, by target; none if it failed.

    `unreached` are the targets whose carrier the attack did not reach; `failure` says why there are no images.
    """

    name: str
    images: Mapping[str, Image]
    unreached: frozenset[str] = frozenset()
    failure: str = ""


def chosen(outcomes: Sequence[Outcome], sweeps: Mapping[str, Sequence[str]]) -> list[Outcome]:
    """Return one variant of each attack, in the order of `outcomes`.

    Of the variants of one attack at several strengths (`sweeps`), it is the one with the highest Score, or the first
    if no Score is known; of GSPure's variants, the method itself.
    """
    by_name = {outcome.variant: outcome for outcome in outcomes}
    passed = set()
    for names in sweeps.values():
        known = [by_name[name] for name in names if name in by_name]
        if known:
            passed |= {outcome.variant for outcome in known} - {max(known, key=_merit).variant}
    return [outcome for outcome in outcomes if outcome.variant not in passed and not outcome.is_control]


def _merit(outcome: Outcome) -> tuple[bool, float]:
    return outcome.variant == GSPURE, outcome.score if isfinite(outcome.score) else -np.inf


def typical(truth: Mapping[str, Image], shown: Mapping[str, Image]) -> str:
    """Return the view with the median PSNR, the lower one of two."""
    ranked = sorted(shown, key=lambda view: (psnr(truth[view], shown[view]), view))
    return ranked[(len(ranked) - 1) // 2]


def write_lineup(path: Path, targets: Sequence[str], columns: Sequence[Column]) -> None:
    """Write a column of images for every variant and a row for every target as a PNG, as wide as a page.

    The first column is the reference: it has an image of every target; the PSNR of the others is measured against it.
    More than `COLUMNS` columns are split into blocks of about equal size, one below the other.
    """
    count = ceil(len(columns) / COLUMNS)
    breadth = ceil(len(columns) / count)
    blocks = [columns[first : first + breadth] for first in range(0, len(columns), breadth)]
    tallest = max(np.shape(image)[0] / np.shape(image)[1] for image in columns[0].images.values())
    tile = tallest * ((style.PAGE - _NAMES) / breadth - _PADDING)
    height = _TITLE + len(targets) * (tile + _LABEL)
    with style.page(path, style.PAGE, count * height + (count - 1) * _GAP) as figure:
        parts = figure.subfigures(count, squeeze=False, hspace=_GAP / height)
        for part, block in zip(parts[:, 0], blocks, strict=True):
            grid = part.subplots(len(targets), breadth, squeeze=False)
            for column, axes in zip(block, grid[0], strict=False):
                axes.set_title(textwrap.fill(display_name(column.name), _TITLE_WIDTH), pad=3)
            for target, row in zip(targets, grid, strict=True):
                for column, axes in zip(block, row, strict=False):
                    _draw(axes, column, target, columns[0].images[target])
                row[0].set_ylabel(display_name(target), labelpad=2)
                for axes in row[len(block) :]:
                    axes.set_axis_off()


def _draw(axes: Axes, column: Column, target: str, reference: Image) -> None:
    image = column.images.get(target)
    if image is None:
        show(axes, np.full_like(reference, 0.94), "failed")
        reason = "\n".join(textwrap.wrap(column.failure, _WORDS, max_lines=_LINES, placeholder=" …"))
        axes.text(0.5, 0.5, reason, transform=axes.transAxes, ha="center", va="center", fontsize=4.5, color=style.INK)
    elif image is reference:
        show(axes, image, "")
    else:
        unreached = " †" if target in column.unreached else ""
        show(axes, image, f"{METRICS['psnr'].text(psnr(reference, image))} dB{unreached}")
