"""Control: random pruning of as many rows as GSPure prunes."""

from __future__ import annotations

from gspure.attacks.attack import Attack, Attacked, Mask, Rng
from gspure.attacks.random_pruning import random_mask
from gspure.model.gaussians import Gaussians


def random_matched(model: Gaussians, rng: Rng, prune_mask: Mask) -> Attacked:
    """Remove as many random rows as GSPure's mask does."""
    return Attacked.pruned(model, random_mask(len(model), int(prune_mask.sum()), rng))


ATTACK = Attack("random_matched", random_matched)
