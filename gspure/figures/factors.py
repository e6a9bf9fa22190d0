"""Scene and message against the pruning factors, as in the paper's Fig. 5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from gspure.evaluation.intervals import Interval
from gspure.evaluation.outcomes import MESSAGE, SCENE
from gspure.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS: Final = {SCENE: style.SCENE, MESSAGE: style.MESSAGE}
_LETTERS: Final = 18  # in a line beside a panel
_AXES: Final = (r"noise pruning factor $\tau_n$", r"cluster pruning factor $\tau_c$")


class Point(NamedTuple):
    """GSPure with one pair of pruning factors."""

    factors: tuple[float, float]  # tau_n and tau_c
    means: Mapping[str, Interval]  # over scenes, of scene and message


def curve(points: Sequence[Point], axis: int, method: tuple[float, float]) -> list[Point]:
    """Return the points along one factor, in ascending order, where the other one is that of `method`."""
    chosen = {p.factors[axis]: p for p in points if p.factors[1 - axis] == method[1 - axis]}
    return [chosen[factor] for factor in sorted(chosen)]


def write_factor_curves(
    path: Path, points: Sequence[Point], method: tuple[float, float], message: str = "message PSNR (dB)"
) -> None:
    """Write a panel for each factor and target, as PNG and SVG; a ring marks `method`, its tau_n and tau_c.

    A target that some point lacks is left out. `message` is the label of the message's axis.
    """
    labels = {SCENE: "scene PSNR (dB)", MESSAGE: message}
    targets = [target for target in labels if all(target in point.means for point in points)]
    with style.page(path, style.COLUMN, 0.45 + 1.05 * len(targets), vector=True) as figure:
        grid = figure.subplots(len(targets), 2, sharex="col", sharey="row", squeeze=False)
        for row, target in zip(grid, targets, strict=True):
            for axis, axes in enumerate(row):
                _draw(axes, curve(points, axis, method), axis, target, method)
            row[0].set_ylabel(fill(labels[target], _LETTERS))
        for axes, label in zip(grid[-1], _AXES, strict=True):
            axes.set_xlabel(label, parse_math=True)


def _draw(axes: Axes, points: Sequence[Point], axis: int, target: str, method: tuple[float, float]) -> None:
    factors = [point.factors[axis] for point in points]
    means, low, high = np.array([point.means[target][:3] for point in points]).T
    axes.fill_between(factors, low, high, color=style.tint(_COLOURS[target], 0.82), linewidth=0)
    axes.plot(factors, means, "o-", color=_COLOURS[target], linewidth=1.1, markersize=2.6)
    at = factors.index(method[axis])
    axes.plot(method[axis], means[at], "o", markersize=6, markerfacecolor="none", markeredgecolor=style.INK, mew=0.7)
    axes.set_xticks(factors, [f"{factor:g}" for factor in factors])
    axes.grid(axis="y", color=style.tint(style.FAINT, 0.75), linewidth=0.4)
    axes.set_axisbelow(True)
