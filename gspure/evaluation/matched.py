"""Attacks compared at equal damage to the scene, averaged over scenes.

An attack that destroys scene and message can have a high Score. The drop of the message at a *fixed* drop of the scene,
read from a sweep over the attack's strength, avoids this.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gspure.arrays import Bools
from gspure.evaluation.identity import OfCondition
from gspure.evaluation.outcomes import Outcome, by_condition, cells, extractions
from gspure.grouping import grouped
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.metrics.names import UNATTACKED
from gspure.metrics.statistics import Interval, by_scene, mean_interval, scene_means
from gspure.metrics.targets import SCENE
from gspure.text import decimal

Sweeps = Mapping[str, Sequence[str]]  # names of attacks, with the variants that are this attack at several strengths


MATCHED_DAMAGES: Final = (0.3, 0.7, 1.5, 2.0)  # dB, from barely visible to the customary 2 dB


class Drops(NamedTuple):
    """What one variant does to one model, and the damage for which its strength was searched (NaN without a search)."""

    scene: float  # drop of the scene's PSNR, dB
    message: float  # drop of the message's PSNR, dB
    wanted: float = math.nan


Curve = Mapping[str, Drops]  # the drops of one model by variant
Curves = Mapping[tuple[str, int], Curve]  # by scene and seed


class Point(NamedTuple):
    """What a sweep does to one model at a permitted damage."""

    message: float  # drop of the message's PSNR, dB
    scene: float  # drop of the scene's PSNR, dB: the permitted one, unless no strength comes near it

    @classmethod
    def at(cls, damage: float, curve: Curve) -> Point | None:
        """Return the point of a sweep at a permitted drop of the scene, in dB.

        It is that of the variant whose strength was searched for this damage, or else interpolated between the tested
        strengths. If all of them are gentler, the largest drop of the message counts; if all are harsher, there is no
        point.
        """
        for drops in curve.values():
            if drops.wanted == damage:
                is_near = abs(drops.scene - damage) <= DAMAGE_TOLERANCE
                return cls(drops.message, damage if is_near else drops.scene)
        scenes = np.array([drops.scene for drops in curve.values()])
        messages = np.array([drops.message for drops in curve.values()])
        drop = matched_message_drop(scenes, messages, damage)
        if drop is not None:
            return cls(drop, damage)
        most = messages.argmax()
        return cls(float(messages[most]), float(scenes[most])) if scenes.max() < damage else None


class Matched(NamedTuple):
    """One sweep at one damage to the scene."""

    condition: OfCondition
    extraction: str  # the target that shows the message
    sweep: str
    strengths: int
    damage: float  # permitted drop of the scene's PSNR, dB
    drop: Interval  # of the message's PSNR, dB; a lower bound if `scene_drop` is below `damage`, an upper one if above
    gentle: int  # number of models that no strength damages this much; there, the largest drop of the message counts
    scene_drop: float  # mean drop of the scene's PSNR, dB; `damage` unless no strength comes near it


def title_with_damage(title: str, wanted: float, *scene_drops: float) -> str:
    """Return the title of a variant, with the range of its drops, in dB, where any misses the wanted damage."""
    known = sorted(filter(math.isfinite, scene_drops))
    if not any(abs(drop - wanted) > DAMAGE_TOLERANCE for drop in known):  # False without a wanted damage
        return title
    bounds = dict.fromkeys([decimal(known[0]), decimal(known[-1])])
    return f"{title} ({' to '.join(bounds)} dB reached)"


def titles_with_damage(outcomes: Iterable[Outcome]) -> dict[str, str]:
    """Return the `title_with_damage` of every variant, from the mean over seeds in each of its scenes."""
    titles = {}
    for variant, alike in grouped(outcomes, lambda o: o.variant).items():
        means = scene_means(cells(alike, lambda o: o.damage))
        titles[variant] = title_with_damage(alike[0].title, alike[0].wanted, *means.values())
    return titles


def damages(outcomes: Iterable[Outcome]) -> Sequence[float]:
    """Return the damages at which to compare: those that strengths were searched for, or else `MATCHED_DAMAGES`."""
    return sorted({o.wanted for o in outcomes if not math.isnan(o.wanted)}) or MATCHED_DAMAGES


def match(outcomes: Sequence[Outcome], sweeps: Sweeps) -> list[Matched]:
    """Compare sweeps at equal `damages`, for every condition and extraction of the message, in their order.

    An attack in none of the sweeps is one of a single strength. A sweep has no row at a damage that all its strengths
    exceed on some model, or that the search missed from above on some models and from below on others.
    """
    rows = []
    attacks = completed(sweeps, (o.variant for o in outcomes if o.variant != UNATTACKED and not o.is_control))
    for condition, alike in by_condition(outcomes).items():
        for extraction in extractions(alike):
            known = curves(alike, extraction)
            for name, variants in attacks.items():
                strengths = max((len(curve.keys() & {*variants}) for curve in known.values()), default=0)
                for damage in damages(alike):
                    mean = _mean_point(points(known, variants, damage), damage)
                    if mean is not None:
                        rows.append(Matched(condition, extraction, name, strengths, damage, *mean))
    return rows


class _MeanPoint(NamedTuple):
    """The last fields of `Matched`."""

    drop: Interval
    gentle: int
    scene_drop: float


def _mean_point(by_cell: Mapping[tuple[str, int], Point | None], damage: float) -> _MeanPoint | None:
    """Return the mean over scenes of the points of a sweep at a damage; None unless they can be averaged."""
    known = {cell: point for cell, point in by_cell.items() if point}
    is_above = {point.scene > damage for point in known.values() if point.scene != damage}
    if not known or len(known) < len(by_cell) or len(is_above) == 2:
        return None
    drop = mean_interval(by_scene({cell: point.message for cell, point in known.items()}))
    gentle = sum(point.scene < damage for point in known.values())
    scenes = scene_means({cell: point.scene for cell, point in known.items()})
    scene_drop = float(np.mean([*scenes.values()])) if is_above else damage
    return _MeanPoint(drop, gentle, scene_drop)


def points(known: Curves, sweep: Sequence[str], damage: float) -> dict[tuple[str, int], Point | None]:
    """Return the `Point.at` a damage in every model that the sweep was run on."""
    swept = {cell: {name: curve[name] for name in curve if name in sweep} for cell, curve in known.items()}
    return {cell: Point.at(damage, curve) for cell, curve in swept.items() if curve}


def completed(sweeps: Sweeps, variants: Iterable[str]) -> dict[str, Sequence[str]]:
    """Return the sweeps, plus one of a single strength for every variant in none of them."""
    swept = {variant for names in sweeps.values() for variant in names}
    return {**sweeps, **{variant: [variant] for variant in variants if variant not in swept}}


def curves(variants: Sequence[Outcome], extraction: str) -> Curves:
    """Return the drops where both are known."""
    by_cell: dict[tuple[str, int], dict[str, Drops]] = {}
    for o in variants:
        drops = Drops(o.psnr_drop(SCENE), o.drop(extraction), o.wanted)
        if not math.isnan(drops.scene) and not math.isnan(drops.message):
            by_cell.setdefault((o.scene, o.seed), {})[o.variant] = drops
    return by_cell


def pareto_front(scene_drops: ArrayLike, message_residuals: ArrayLike) -> Bools:
    """Return which points no other one dominates, that is, equals or undercuts in both and undercuts in one: bool [n].

    An attacker minimizes both the damage to the scene and what remains of the message, such as its PSNR.
    """
    points = np.column_stack([scene_drops, message_residuals])
    no_worse = (points[:, None] <= points).all(axis=2)
    better = (points[:, None] < points).any(axis=2)
    return np.asarray(~(no_worse & better).any(axis=0))


def matched_message_drop(scene_drops: ArrayLike, message_drops: ArrayLike, at: float) -> float | None:
    """Return the drop of the message at a fixed drop of the scene, `at`, dB; None outside the scene drops of the sweep.

    Drops [n] are those of one point per strength. The result is linear between neighbouring points of the sweep's
    Pareto front.
    """
    points = np.column_stack([scene_drops, message_drops])
    if not points[:, 0].min() <= at <= points[:, 0].max():
        return None
    front = np.unique(points[pareto_front(points[:, 0], -points[:, 1])], axis=0)
    return float(np.interp(at, front[:, 0], front[:, 1]))
