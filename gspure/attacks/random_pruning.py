"""Random Gaussian pruning (paper, §Intuitive Methods, 1)."""

from __future__ import annotations

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Mask, Rng
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians

FRACTION = 0.25
"""Share of the Gaussians to remove. Ours: the paper says "a certain ratio"."""


def random_pruning(model: Gaussians, rng: Rng, *, fraction: float = FRACTION) -> Attacked:
    """Remove a random `fraction` (0 to 1) of the Gaussians, rounded to a whole number of them."""
    if not 0 <= fraction <= 1:
        raise InputError("attack random_pruning", "fraction", expected="0 to 1", found=str(fraction))
    kept = random_mask(len(model), round(fraction * len(model)), rng)
    return Attacked(model.subset(kept), kept)


def random_mask(count: int, removed: int, rng: Rng) -> Mask:
    """Return a mask [count] that is false at exactly `removed` random places."""
    kept = np.ones(count, np.bool_)
    kept[rng.choice(count, removed, replace=False)] = False
    return kept


ATTACK = Attack("random_pruning", random_pruning)
