"""Reordering: the same rows in another order, which no image depends on."""

from __future__ import annotations

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.model.gaussians import Gaussians


def reorder(model: Gaussians, rng: Rng) -> Attacked:
    """Shuffle the rows."""
    return Attacked.taken(model, rng.permutation(len(model)))


ATTACK = Attack("reorder", reorder)
