"""Trade-off of all variants of a scheme: damage to the scene against quality of the message, with the Pareto front."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from gspure.evaluation.names import display_name
from gspure.evaluation.outcomes import GSPURE, MESSAGE, SCENE, UNATTACKED, Outcome
from gspure.evaluation.statistics import MATCHED_DAMAGES, pareto_front
from gspure.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LINEAR: Final = 2.0  # dB; further right the axis is logarithmic, for attacks that destroy the scene
_LETTERS: Final = 70  # in a line of the key
_APART: Final = 7.0  # points of type, between two numbers
_TICKS: Final = (0, 0.5, 1, 1.5, 2, 3, 5, 10, 20)


class Place(NamedTuple):
    """Variants with equal results, and these results as means over the scenes."""

    damage: float
    """Drop of the scene's PSNR, dB."""

    residual: float
    """PSNR of the message, dB."""

    variants: tuple[str, ...]


def places(outcomes: Sequence[Outcome]) -> list[Place]:
    """Return the results of the variants of one scheme, by damage; variants that lack a scene are left out."""
    known: dict[str, list[tuple[float, float]]] = {}
    for o in outcomes:
        drops = np.array([o.psnr_drop(SCENE), o.psnr_drop(MESSAGE)])
        if not o.is_control and (np.abs(drops) < style.MOST_DECIBELS).all():
            known.setdefault(o.variant, []).append((o.psnr_drop(SCENE), o.targets[MESSAGE].psnr))
    scenes = max(map(len, known.values()), default=0)
    at = {name: np.mean(points, axis=0).tolist() for name, points in known.items() if len(points) == scenes}
    listed = groupby(sorted(at, key=lambda name: at[name]), key=lambda name: at[name])
    return [Place(damage, residual, tuple(names)) for (damage, residual), names in listed]


def write_tradeoff(path: Path, outcomes: Sequence[Outcome], floor: float | None = None) -> list[Place]:
    """Write the variants of one scheme as points of a PNG; return those on the front, in the order of their numbers.

    Parameters
    ----------
    path : Path
        PNG to write.
    outcomes : sequence of Outcome
        All variants of one scheme.
    floor : float, optional
        Mean over the scenes of the highest control (`gspure.evaluation.survival.floor`), dB; drawn as a line.

    """
    listed = places(outcomes)
    damage, residual = [place.damage for place in listed], [place.residual for place in listed]
    on_front = pareto_front(damage, residual)
    front = [place for place, chosen in zip(listed, on_front, strict=True) if chosen]
    with style.page(path, style.COLUMN, 2.3 + 0.13 * len(front)) as figure:
        axes = figure.add_subplot()
        axes.plot(damage, residual, "o", color=style.KEPT, markersize=2.4, label="variant")
        line = [(place.damage, place.residual) for place in front]
        axes.step(*zip(*line, strict=True), where="post", color=style.INK, linewidth=0.8)
        axes.plot(*zip(*line, strict=True), "o", color=style.INK, markersize=3.2, label="Pareto front")
        for name, marker in ((UNATTACKED, "s"), (GSPURE, "D")):
            for place in (place for place in listed if name in place.variants):
                colour = style.PRUNED if name == GSPURE else style.SCENE
                axes.plot(*place[:2], marker, color=colour, markersize=4.4, label=display_name(name), linestyle="none")
        if floor is not None:
            axes.axhline(floor, color=style.MESSAGE, linewidth=0.7, linestyle="--", label="floor (highest control)")
        _scale(axes, damage)
        _number(axes, line)
        axes.set_xlabel("damage to the scene: drop of PSNR (dB)")
        axes.set_ylabel("quality of the message: PSNR (dB)")
        figure.legend(loc="outside upper center", ncols=3)
        key = "\n".join(f"{i}  {_named(place)}" for i, place in enumerate(front, start=1))
        axes.annotate(
            key, (0, 0), (0, -26), "axes fraction", textcoords="offset points", va="top", fontsize=6, linespacing=1.3
        )
    return front


def _scale(axes: Axes, damage: Sequence[float]) -> None:
    most = max(*damage, _LINEAR)
    axes.set_xscale("symlog", linthresh=_LINEAR)
    axes.set_xlim(min(damage) - 0.15, most * 1.15)
    axes.margins(y=0.1)  # for numbers below the lowest points
    shown = [tick for tick in _TICKS if tick <= most * 1.1]
    axes.set_xticks(shown, [f"{tick:g}" for tick in shown])
    axes.minorticks_off()
    for matched in MATCHED_DAMAGES:
        axes.axvline(matched, color=style.tint(style.FAINT, 0.7), linewidth=0.4, zorder=0)


def _number(axes: Axes, line: Sequence[tuple[float, float]]) -> None:
    """Write numbers on the empty side of the front; neighbours that are too close share a label."""
    at = axes.transData.transform(line) * 72 / style.DPI  # in points
    starts = [0, *(np.flatnonzero(np.hypot(*np.diff(at, axis=0).T) > _APART) + 1).tolist(), len(line)]
    for first, end in pairwise(starts):
        label = str(end) if end == first + 1 else f"{first + 1}\N{EN DASH}{end}"
        axes.annotate(label, line[end - 1], (-3, -3), textcoords="offset points", ha="right", va="top", fontsize=5.5)


def _named(place: Place) -> str:
    names = [display_name(name) for name in sorted(place.variants, key=lambda name: name != GSPURE)]
    return shorten(" = ".join(names), _LETTERS, placeholder=" …")
