"""Control: as many rows as GSPure prunes, but those with the lowest weights."""

from __future__ import annotations

from gspure.attacks.attack import Attack, Attacked, Mask, Rng, Weights
from gspure.attacks.ranking import lowest_mask
from gspure.model.gaussians import Gaussians


def lowest_weight_matched(model: Gaussians, _rng: Rng, weights: Weights, prune_mask: Mask) -> Attacked:
    """Remove as many rows as GSPure's mask does, in ascending order of ω_k."""
    return Attacked.pruned(model, lowest_mask(weights, int(prune_mask.sum())))


ATTACK = Attack("lowest_weight_matched", lowest_weight_matched)
