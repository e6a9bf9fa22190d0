"""The evidence of a message against the damage to the scene: a line per attack, and the robust radius."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from gspure.evaluation.radius import Radius
from gspure.evaluation.results import ADAPTS, PUBLISHED, OwnerName, Result
from gspure.figures import style
from gspure.grouping import grouped
from gspure.metrics.names import display_name
from gspure.metrics.statistics import scene_means

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

MOST_DAMAGE: Final = 8.0  # dB; attacks that do more are drawn at the edge
_TICKS: Final = (0, 0.1, 0.3, 1, 2, 3, 5, 8)
_LETTERS: Final = 22  # most letters of a name
_NAMED: Final = 9  # attacks with a colour and an entry of the legend: those that end the message first


class Point(NamedTuple):
    """One attack at one strength, mean over scenes."""

    attack: str  # the display name of its entry in the configuration, or of its first strength
    damage: float  # dB, 0 to `MOST_DAMAGE`
    evidence: float
    is_proven: bool  # in all scenes


def points(rows: Sequence[Result]) -> list[Point]:
    """Return the attacks of one owner by name and damage, where damage and evidence are known."""
    found = []
    names = {row.attack: display_name(row.entry or row.variant) for row in reversed(rows)}
    for (attack, _), alike in grouped(rows, lambda row: (row.attack, row.variant)).items():
        damage = _mean([(row, row.damage) for row in alike])
        evidence = _mean([(row, _evidence(row)) for row in alike])
        if isfinite(damage + evidence):
            within = float(np.clip(damage, 0, MOST_DAMAGE))
            found.append(Point(names[attack], within, evidence, all(row.is_proven for row in alike)))
    return sorted(found, key=lambda point: (point.attack, point.damage))


def _evidence(row: Result) -> float:
    """Return the standard score of a picture's trace, or the negative decimal logarithm of the p-value of bits."""
    if isfinite(row.z):
        return row.z
    return float(-np.log10(row.p)) if row.p > 0 else np.nan


def _mean(values: Sequence[tuple[Result, float]]) -> float:
    """Return the mean over scenes of the means over their seeds."""
    known = {(row.scene, row.seed): value for row, value in values if isfinite(value)}
    return float(np.mean([*scene_means(known).values()])) if known else np.nan


def draw_evidence(path: Path, rows: Sequence[Result], known: Sequence[Radius]) -> str | None:
    """Draw the attacks of one condition as PNG and SVG, and return the caption; None if no damage is known."""
    by_owner = _by_owner(rows)
    if not any(by_owner.values()):
        return None
    with style.page(path, style.COLUMN, 3.0, vector=True) as figure:
        _draw_condition(figure.add_subplot(), rows, known, _named(rows))
        figure.legend(loc="outside upper center", ncols=3)
    lines = "Solid: the owner who adapts; dotted: as published. " if by_owner[ADAPTS] else ""
    return (
        "Evidence that the message is there, against the damage that each attack does to the scene, mean over the "
        f"scenes. {lines}Filled: proven in all; open: not. Grey band: too little evidence for a proof; grey lines: "
        "further attacks. Star: the robust radius; ring: the readable radius."
    )


def draw_conditions(path: Path, conditions: Mapping[str, tuple[Sequence[Result], Sequence[Radius]]]) -> None:
    """Draw a panel for each condition, by its title, two beside each other, as PNG; attacks share their colours."""
    lines = -(-len(conditions) // 2)
    named = _named([row for rows, _ in conditions.values() for row in rows])
    with style.page(path, style.PAGE, 2.4 * lines + 0.3) as figure:
        entries: dict[str, Artist] = {}
        for number, (title, (rows, known)) in enumerate(conditions.items(), 1):
            axes = figure.add_subplot(lines, 2, number)
            _draw_condition(axes, rows, known, named)
            axes.set_title(title)
            handles, labels = axes.get_legend_handles_labels()
            entries |= dict(zip(labels, handles, strict=True))
        figure.legend(entries.values(), entries, loc="outside upper center", ncols=5)


def _named(rows: Sequence[Result]) -> list[str]:
    """Return the attacks with a colour: those that end the message first."""
    by_owner = _by_owner(rows)
    in_order = sorted(by_owner[ADAPTS] + by_owner[PUBLISHED], key=lambda point: (point.is_proven, point.damage))
    return [*dict.fromkeys(point.attack for point in in_order)][:_NAMED]


def _by_owner(rows: Sequence[Result]) -> dict[OwnerName, list[Point]]:
    attacked = [row for row in rows if row.is_attack and row.owner]
    owners: tuple[OwnerName, ...] = (ADAPTS, PUBLISHED)
    return {owner: points([row for row in attacked if row.owner == owner]) for owner in owners}


def _draw_condition(axes: Axes, rows: Sequence[Result], known: Sequence[Radius], named: Sequence[str]) -> None:
    """Draw the attacks of one condition: a line each, for the owner who adapts and as published."""
    by_owner = _by_owner(rows)
    best = by_owner[ADAPTS] or by_owner[PUBLISHED]
    is_picture = any(isfinite(row.z) for row in rows if row.is_attack and row.owner)
    _draw_owner(axes, best, named, "-")
    if by_owner[ADAPTS]:
        _draw_owner(axes, by_owner[PUBLISHED], named, ":")
    axes.axhspan(*_unproven(rows), color=style.tint(style.FAINT, 0.8), linewidth=0, zorder=0)
    _mark(axes, known)
    _scale(axes, [point.evidence for points_of in by_owner.values() for point in points_of])
    axes.set_xlabel("damage to the scene (dB)")
    axes.set_ylabel("standard score of the trace" if is_picture else "−log₁₀ of the p-value")


def _draw_owner(axes: Axes, known: Sequence[Point], named: Sequence[str], dash: str) -> None:
    """Draw a line for each attack; `named` ones have a colour and, if solid, an entry of the legend."""
    for attack, alike in grouped(known, lambda point: point.attack).items():
        is_named = attack in named
        colour = style.CLUSTERS[named.index(attack)] if is_named else style.FAINT
        label = shorten(attack, _LETTERS, placeholder=" …") if is_named and dash == "-" else None
        damage = [point.damage for point in alike]
        evidence = [point.evidence for point in alike]
        axes.plot(damage, evidence, dash, color=colour, linewidth=0.9, label=label)
        look: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 2.8, "markeredgecolor": colour}
        for point in alike:
            fill = colour if point.is_proven else "white"
            axes.plot(point.damage, point.evidence, markerfacecolor=fill, markeredgewidth=0.6, **look)


def _unproven(rows: Sequence[Result]) -> tuple[float, float]:
    """Return the range of evidence in which nothing is proven."""
    from scipy.special import ndtri

    level = max((row.level for row in rows if isfinite(row.level)), default=0.001)
    if any(isfinite(row.z) for row in rows):
        return -1000.0, float(-ndtri(level))
    return 0.0, float(-np.log10(level))


def _mark(axes: Axes, known: Sequence[Radius]) -> None:
    """Draw a star at the message radius and a ring at the readable one, of the owner who adapts if there is one."""
    low = axes.get_ylim()[0]
    for kind, marker, size in (("message", "*", 8.0), ("readable", "o", 5.0)):
        of_kind = {radius.owner: radius for radius in known if radius.kind == kind}
        radius = of_kind.get(ADAPTS, of_kind.get(PUBLISHED))
        if radius and isfinite(radius.radius) and not radius.exceeds:
            at = min(radius.radius, MOST_DAMAGE)
            fill = style.INK if marker == "*" else "none"
            look: dict[str, Any] = {"markerfacecolor": fill, "markeredgecolor": style.INK, "clip_on": False}
            axes.plot(at, max(low, 0.0), marker, markersize=size, zorder=5, **look)
            if kind == "message":
                killer = display_name(radius.killer.partition("@")[0])
                axes.annotate(
                    killer, (at, max(low, 0.0)), (5, 4), textcoords="offset points", fontsize=6.5, color=style.INK
                )


def _scale(axes: Axes, evidence: Sequence[float]) -> None:
    """Stretch small damage and small evidence."""

    def root(values: Any) -> Any:
        return np.sign(values) * np.sqrt(np.abs(values))

    def square(values: Any) -> Any:
        return np.sign(values) * np.square(values)

    axes.set_xscale("function", functions=(root, square))
    axes.set_xlim(0, MOST_DAMAGE * 1.03)
    axes.set_xticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
    axes.set_yscale("function", functions=(root, square))
    axes.set_ylim(min(0.0, 1.1 * min(evidence)), 1.15 * max(*evidence, 4.0))
