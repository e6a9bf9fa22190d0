r"""The robust radius: the least damage to the scene at which a message is gone, over all attacks that were tried.

For one model and one owner,

.. math:: r = \min \{\, \max(0, d_a) : \text{the message is not proven after attack } a \,\}

with the damage :math:`d_a` of an attack in dB; the readable radius counts attacks after which it is not readable. If no
attack ends it, the radius exceeds the largest damage tried. Over scenes, it is the median. (docs/statistics.md)
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf, isfinite, isnan, nan
from typing import Final, Literal, NamedTuple

import numpy as np

from gspure.evaluation.identity import Condition, ModelId, OfCondition
from gspure.evaluation.results import READABLE, OwnerName, Result
from gspure.grouping import grouped
from gspure.metrics.names import UNATTACKED
from gspure.text import decimal

RADIUS: Final = "radius.json"  # file of a run
FINEST: Final = 0.05  # damage below this is written as "< 0.05", dB

Kind = Literal["message", "readable"]
KINDS: Final[Mapping[Kind, Callable[[Result], bool]]] = {
    "message": lambda row: row.is_proven,
    "readable": lambda row: row.word == READABLE,
}


class ModelRadius(NamedTuple):
    """The radius of one model for one owner."""

    model: ModelId
    kind: Kind
    owner: OwnerName
    extraction: str
    radius: float  # dB; the largest damage tried if no attack ends the message; NaN without photographs
    exceeds: bool  # whether no attack ends the message: its radius is larger
    killer: str = ""  # variant that ends it with the least damage; the one of highest fidelity without photographs
    fidelity: float = nan  # of the killer, dB; without photographs


class Radius(NamedTuple):
    """The radius of one condition: the median over its scenes, with their range."""

    condition: OfCondition
    kind: Kind
    owner: OwnerName
    extraction: str
    radius: float
    exceeds: bool
    low: float
    high: float
    scenes: int
    killer: str = ""
    fidelity: float = nan

    def __str__(self) -> str:
        return radius_text(self.radius, exceeds=self.exceeds)


class RadiusRecord(NamedTuple):
    """The content of `RADIUS`."""

    models: tuple[ModelRadius, ...]
    conditions: tuple[Radius, ...]


class Record(NamedTuple):
    """The radii of a run as the leaderboard collects them: the content of `RADIUS`, and how it was measured."""

    gspure: str  # version
    suite: str  # name of the list of attacks
    date: str  # 2026-11-29
    scenes: int
    size: str  # of the views: 400x300
    results: str  # SHA-256 of results.csv
    conditions: tuple[Radius, ...]
    models: tuple[ModelRadius, ...]


def radius_text(radius: float, *, exceeds: bool) -> str:
    """Return a radius as people write it: ``0.3 dB``, ``> 2.1 dB``, ``< 0.05 dB``."""
    if isnan(radius):
        return "unknown"
    if exceeds:
        return f"> {decimal(radius, 1)} dB"
    return f"< {FINEST} dB" if radius < FINEST else f"{decimal(radius, 2 if radius < 1 else 1)} dB"


def model_radii(rows: Iterable[Result]) -> list[ModelRadius]:
    """Return the radii of every model and owner whose message is proven, or readable, before any attack."""
    radii = []
    for (model, owner, extraction), alike in grouped(rows, lambda row: (row.model, row.owner, row.extraction)).items():
        for kind, holds in KINDS.items():
            before = [row for row in alike if row.variant == UNATTACKED]
            attacked = [row for row in alike if row.is_attack and row.word]
            if owner and attacked and before and holds(before[0]):
                radii.append(_model_radius(model, kind, owner, extraction, attacked))
    return radii


def _model_radius(
    model: ModelId, kind: Kind, owner: OwnerName, extraction: str, attacked: Sequence[Result]
) -> ModelRadius:
    """Return the radius of one model from the results of its attacks."""
    ended = [row for row in attacked if not KINDS[kind](row)]
    if all(isnan(row.damage) for row in attacked):
        gentlest = max(ended, key=lambda row: row.fidelity, default=None)
        if gentlest is None:
            return ModelRadius(model, kind, owner, extraction, nan, exceeds=True)
        return ModelRadius(
            model,
            kind,
            owner,
            extraction,
            nan,
            exceeds=False,
            killer=gentlest.variant,
            fidelity=gentlest.fidelity,
        )
    killer = min((row for row in ended if isfinite(row.damage)), key=lambda row: row.damage, default=None)
    if killer is None:
        most = max(row.damage for row in attacked if isfinite(row.damage))
        return ModelRadius(model, kind, owner, extraction, max(0.0, most), exceeds=True)
    return ModelRadius(model, kind, owner, extraction, max(0.0, killer.damage), exceeds=False, killer=killer.variant)


def radii(of_models: Iterable[ModelRadius], conditions: Mapping[ModelId, Condition]) -> list[Radius]:
    """Return the median radius of every condition, owner and kind; seeds of a scene are averaged by their median."""

    def facts(one: ModelRadius) -> tuple[Condition, Kind, OwnerName, str]:
        return conditions[one.model], one.kind, one.owner, one.extraction

    return [_over_scenes(*common, alike) for common, alike in grouped(of_models, facts).items()]


def _over_scenes(
    condition: Condition, kind: Kind, owner: OwnerName, extraction: str, alike: Sequence[ModelRadius]
) -> Radius:
    """Return the median over scenes; of an even number, the smaller of the two in the middle."""
    by_scene = grouped(alike, lambda one: one.model.scene)
    scenes = [_median(seeds) for seeds in by_scene.values()]
    middle = _median(scenes)
    known = [one.radius for one in scenes]
    return Radius(
        condition=condition,
        kind=kind,
        owner=owner,
        extraction=extraction,
        radius=middle.radius,
        exceeds=middle.exceeds,
        low=float(np.min(known)),
        high=inf if any(one.exceeds for one in scenes) else float(np.max(known)),
        scenes=len(scenes),
        killer=middle.killer,
        fidelity=middle.fidelity,
    )


def _median(alike: Sequence[ModelRadius]) -> ModelRadius:
    """Return the one in the middle, the lower of two; radii that exceed what was tried are last.

    Without photographs, the order is that of fidelity, the highest first.
    """
    in_order = sorted(alike, key=lambda one: (one.exceeds, -one.fidelity if isnan(one.radius) else one.radius))
    return in_order[(len(in_order) - 1) // 2]
