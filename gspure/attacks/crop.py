"""Crop: the theft of a part of the scene."""

from __future__ import annotations

from typing import Final

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.settings import require_share
from gspure.model.gaussians import Gaussians

FRACTION: Final = 0.5
"""Side of the box, as a share of the model's. Ours."""

FLOATERS: Final = 0.01
"""Share of the centres beyond the model's box, at either end of each axis. Ours."""


def crop(model: Gaussians, _rng: Rng, *, fraction: float = FRACTION) -> Attacked:
    """Keep what stands in a box around the median of the centres, on each axis `fraction` (0 to 1) of the model's."""
    require_share("crop", "fraction", fraction)
    if not len(model):
        return Attacked.pruned(model, np.ones(0, np.bool_))
    means = model.means.astype(np.float64)
    low, median, high = np.quantile(means, [FLOATERS, 0.5, 1 - FLOATERS], axis=0)
    inside = (means >= median + fraction * (low - median)) & (means <= median + fraction * (high - median))
    return Attacked.pruned(model, inside.all(axis=1))


ATTACK = Attack("crop", crop)
