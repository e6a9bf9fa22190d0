"""The message's drop at equal damage to the scene, averaged over scenes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from typing import Final, NamedTuple

import numpy as np

from gspure.evaluation.outcomes import SCENE, UNATTACKED, Outcome, ordered
from gspure.evaluation.statistics import (
    MATCHED_DAMAGES,
    Interval,
    by_scene,
    matched_message_drop,
    mean_interval,
)

Sweeps = Mapping[str, Sequence[str]]
"""Names of attacks, with the variants that are this attack at several strengths."""

Drops = tuple[float, float]
"""Drop of the scene's and of the message's PSNR, dB."""

NO_DROPS: Final[Drops] = (0.0, 0.0)
"""A point of every sweep, since every attack can be weakened to none."""


class Matched(NamedTuple):
    """One sweep at one damage to the scene."""

    scheme: str
    extraction: str
    """The target that shows the message."""

    sweep: str
    strengths: int
    damage: float
    """Permitted drop of the scene's PSNR, dB."""

    drop: Interval
    """Drop of the message's PSNR, dB; a lower bound if `gentle` is not 0."""

    gentle: int
    """Number of models that no tested strength damages this much; there, the largest drop of the message counts."""


def match(outcomes: Sequence[Outcome], sweeps: Sweeps) -> list[Matched]:
    """Compare sweeps at `MATCHED_DAMAGES`, for every scheme and extraction of the message.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Sorted by scheme (`gspure.evaluation.outcomes.collect`).
    sweeps : mapping
        Variants that a scheme lacks, or that failed on its models, are skipped. An attack in none of the sweeps is one
        of a single strength.

    """
    rows = []
    sweeps = completed(sweeps, (o.variant for o in outcomes if o.variant != UNATTACKED and not o.is_control))
    for scheme, group in groupby(outcomes, key=lambda o: o.scheme):
        of_scheme = list(group)
        for extraction in ordered({target for o in of_scheme for target in o.messages}):
            for name, variants in sweeps.items():
                curves = _curves([o for o in of_scheme if o.variant in variants], extraction)
                strengths = max(map(len, curves.values()), default=0)
                rows += [
                    Matched(scheme, extraction, name, strengths, damage, *_mean_drop(curves, damage))
                    for damage in MATCHED_DAMAGES
                    if curves
                ]
    return rows


def completed(sweeps: Sweeps, variants: Iterable[str]) -> dict[str, Sequence[str]]:
    """Return the sweeps, plus one of a single strength for every variant in none of them."""
    swept = {variant for names in sweeps.values() for variant in names}
    return {**sweeps, **{variant: [variant] for variant in variants if variant not in swept}}


def drop_within(points: Sequence[Drops], damage: float) -> tuple[float, bool]:
    """Return the message's drop at a permitted drop of the scene, dB, and whether no strength reaches that drop.

    `points` are the drops of one model, by strength. If all strengths are gentler, the largest drop of the message
    counts.
    """
    scene, message = np.array([NO_DROPS, *points]).T
    drop = matched_message_drop(scene, message, damage)
    return (float(message.max()), True) if drop is None else (drop, False)


def _curves(variants: Sequence[Outcome], extraction: str) -> dict[tuple[str, int], list[Drops]]:
    """Return the drops by scene and seed, one per strength for which both are known."""
    curves: dict[tuple[str, int], list[Drops]] = {}
    for o in variants:
        drops = (o.psnr_drop(SCENE), o.psnr_drop(extraction))
        if not any(map(math.isnan, drops)):
            curves.setdefault((o.scene, o.seed), []).append(drops)
    return curves


def _mean_drop(curves: Mapping[tuple[str, int], Sequence[Drops]], damage: float) -> tuple[Interval, int]:
    """Return the mean drop of the message, and the number of models that no strength damages this much."""
    drops = {cell: drop_within(points, damage) for cell, points in curves.items()}
    mean = mean_interval(by_scene({cell: drop for cell, (drop, _) in drops.items()}))
    return mean, sum(gentle for _, gentle in drops.values())
