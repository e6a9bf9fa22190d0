"""Trade-off of all variants of a scheme: damage to the scene against quality of the message, with the Pareto front."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from gspure.evaluation.matched import damages, pareto_front, title_with_damage
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.survival import control_levels
from gspure.figures import style
from gspure.metrics.names import GSPURE, UNATTACKED, display_name
from gspure.metrics.statistics import known_interval, scene_means
from gspure.metrics.targets import MESSAGE, SCENE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINEAR: Final = 2.0  # dB; further right the axis is logarithmic, for attacks that destroy the scene
_LETTERS: Final = 42  # most letters of a name
_NEAR: Final = 2.5  # points of type, between a point and its name
_DISTANCES: Final = (_NEAR, 7.0, 14.0, 24.0)  # from the nearest, until there is room
_TICKS: Final = (0, 0.5, 1, 1.5, 2, 3, 5, 10, 20)


class Place(NamedTuple):
    """A point of the trade-off: variants with equal results, and the means of these over the scenes."""

    damage: float  # drop of the scene's PSNR, dB
    residual: float  # PSNR of the message, dB
    variants: tuple[str, ...]
    titles: tuple[str, ...]  # of the variants


def places(outcomes: Sequence[Outcome]) -> list[Place]:
    """Return the results of the variants of one scheme, by damage.

    Variants without results in some scene or seed are left out. Every scene counts the same.
    """
    known: dict[str, dict[tuple[str, int], tuple[float, float]]] = {}
    for o in outcomes:
        point = (o.psnr_drop(SCENE), o.level(MESSAGE))
        if not o.is_control and np.isfinite(o.psnr_drop(MESSAGE)) and np.isfinite(point).all():
            known.setdefault(o.variant, {})[o.scene, o.seed] = point
    cells = max(known.values(), key=len, default={}).keys()
    variants_at: dict[tuple[float, float], list[str]] = {}
    for variant, points in known.items():
        if points.keys() == cells:
            damage, residual = np.mean([*scene_means(points).values()], axis=0).tolist()
            variants_at.setdefault((damage, residual), []).append(variant)
    first = {o.variant: o for o in reversed(outcomes)}
    listed = []
    for (damage, residual), variants in sorted(variants_at.items()):
        ordered = sorted(variants, key=lambda name: name != GSPURE)
        titles = [title_with_damage(first[name].title, first[name].wanted, damage) for name in ordered]
        listed.append(Place(damage, residual, tuple(ordered), tuple(titles)))
    return listed


def draw_tradeoff(path: Path, outcomes: Sequence[Outcome]) -> str | None:
    """Draw the variants of one condition as named points, as PNG and SVG, and return the caption; None without any."""
    listed = places(outcomes)
    if not listed:
        return None
    floor = known_interval(control_levels(outcomes))
    damage = [place.damage for place in listed]
    residual = [place.residual for place in listed]
    shown = {variant for place in listed for variant in place.variants}
    front = [place for place, is_on in zip(listed, pareto_front(damage, residual), strict=True) if is_on]
    with style.page(path, style.COLUMN, 2.7, vector=True) as figure:
        axes = figure.add_subplot()
        axes.plot(damage, residual, "o", color=style.FAINT, markersize=2.4, label="attack")
        front_damage = [place.damage for place in front]
        front_residual = [place.residual for place in front]
        axes.step(front_damage, front_residual, where="post", color=style.INK, linewidth=0.8)
        axes.plot(front_damage, front_residual, "o", color=style.INK, markersize=3.2, label="Pareto front")
        for name, marker, colour in ((UNATTACKED, "s", style.SCENE), (GSPURE, "D", style.PRUNED)):
            look: dict[str, Any] = {"marker": marker, "color": colour, "markersize": 4.4, "linestyle": "none"}
            for place in listed:
                if name in place.variants:
                    axes.plot(place.damage, place.residual, label=display_name(name), **look)
        if floor is not None:
            axes.axhline(floor.mean, color=style.MESSAGE, linewidth=0.7, linestyle="--", label="highest control")
        _scale(axes, damage, damages(o for o in outcomes if o.variant in shown))
        axes.set_ylabel("PSNR of the message (dB)")
        figure.legend(loc="outside upper center", ncols=3)
        figure.draw_without_rendering()  # places the axes
        _label(axes, [*front, *(place for place in listed if place not in front)])
    left_out = {o.variant: o.title for o in outcomes if not o.is_control and o.variant not in shown}
    caption = (
        "PSNR of the message and drop of the scene's PSNR after every variant, mean over the scenes. Attacks to the "
        "lower left are stronger. Vertical lines: drops at which attacks are compared."
    )
    if left_out:
        caption += f" Not shown, since they lack a scene or a random seed: {', '.join(left_out.values())}."
    if floor is not None:
        caption += " Dashed line: the highest PSNR of a control without the message."
    return caption


def _scale(axes: Axes, damage: Sequence[float], marked: Sequence[float]) -> None:
    """Set the axis of damage, linear up to `LINEAR`, and draw vertical lines at the `marked` ones."""
    most = max(*damage, LINEAR)
    right = 1.05 * next((tick for tick in _TICKS if tick >= most), 1.1 * most)
    axes.set_xscale("symlog", linthresh=LINEAR)
    axes.set_xlim(min(damage) - 0.15, right)
    axes.margins(y=0.1)  # for names below the lowest points
    shown = [tick for tick in _TICKS if tick <= right]
    axes.set_xticks(shown, [f"{tick:g}" for tick in shown])
    axes.minorticks_off()
    label = "drop of the scene's PSNR (dB)"
    if most > LINEAR:
        label += f", logarithmic above {LINEAR:g}"
        place: dict[str, Any] = {"xycoords": axes.get_xaxis_transform(), "ha": "center", "va": "center"}
        axes.annotate("//", (LINEAR, 0), fontsize=6, bbox={"color": "white", "pad": 0.3}, **place)
    axes.set_xlabel(label)
    for level in marked:
        axes.axvline(level, color=style.tint(style.FAINT, 0.7), linewidth=0.4, zorder=0)


def _label(axes: Axes, listed: Sequence[Place]) -> None:
    """Write names beside points, or with a thin line farther away; leave out names for which there is no room."""
    from matplotlib.patheffects import withStroke
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox

    dot = axes.figure.dpi / 72 * 2.5
    points = axes.transData.transform([place[:2] for place in listed])
    taken = [Bbox([at - dot, at + dot]) for at in points]
    for place in listed:
        name = shorten(" = ".join(place.titles), _LETTERS, placeholder=" …")
        for distance, right, above in product(_DISTANCES, (True, False), (True, False)):
            text = axes.annotate(
                name,
                place[:2],
                (distance if right else -distance, distance if above else -distance),
                textcoords="offset points",
                ha="left" if right else "right",
                va="bottom" if above else "top",
                fontsize=5.5,
                in_layout=False,
                path_effects=[withStroke(linewidth=1.5, foreground="white")],
                arrowprops={"arrowstyle": "-", "linewidth": 0.3, "color": style.FAINT} if distance > _NEAR else None,
            )
            text.get_window_extent()  # places the name
            box = Text.get_window_extent(text)  # of the name without the line
            if axes.bbox.count_contains(box.corners()) == 4 and not box.count_overlaps(taken):
                taken.append(box)
                break
            text.remove()
