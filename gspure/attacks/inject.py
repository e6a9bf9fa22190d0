"""Injection: rows that were not there."""

from __future__ import annotations

from typing import Final

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.extent import radius
from gspure.attacks.settings import require_share
from gspure.model.gaussians import Gaussians

FRACTION: Final = 0.1
"""New rows, as a share of the old. Ours: the middle of the published range, 0.05 to 0.3."""

DISTANCE: Final = 0.02
"""Standard deviation of a new row's distance from its model along each axis, as a share of the radius. Ours."""


def inject(model: Gaussians, rng: Rng, *, fraction: float = FRACTION) -> Attacked:
    """Add `fraction` (0 to 1) as many rows as there are: copies of random ones, moved a little; they come last."""
    require_share("inject", "fraction", fraction)
    count = len(model)
    copied = rng.choice(count, round(fraction * count), replace=False)
    rows = np.concatenate([np.arange(count), copied])
    means = model.means[rows]
    means[count:] += DISTANCE * radius(model) * rng.standard_normal((len(copied), 3))
    return Attacked.taken(model, rows, dict(zip("xyz", means.T, strict=True)))


ATTACK = Attack("inject", inject)
