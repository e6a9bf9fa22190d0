"""Random Gaussian pruning (paper, §Intuitive Methods, 1)."""

from __future__ import annotations

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Mask, Rng
from gspure.attacks.settings import require_share
from gspure.model.gaussians import Gaussians

FRACTION = 0.25
"""Share of the rows to remove. Ours: the paper says "a certain ratio"."""


def random_pruning(model: Gaussians, rng: Rng, *, fraction: float = FRACTION) -> Attacked:
    """Remove a random `fraction` (0 to 1) of the rows, rounded to a whole number of them."""
    require_share("random_pruning", "fraction", fraction)
    return Attacked.pruned(model, random_mask(len(model), round(fraction * len(model)), rng))


def random_mask(count: int, removed: int, rng: Rng) -> Mask:
    """Return a mask [count] that is false at exactly `removed` random places."""
    kept = np.ones(count, np.bool_)
    kept[rng.choice(count, removed, replace=False)] = False
    return kept


ATTACK = Attack("random_pruning", random_pruning)
