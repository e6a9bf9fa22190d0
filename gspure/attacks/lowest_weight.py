"""Pruning by contribution: the rows with the lowest weights."""

from __future__ import annotations

from gspure.attacks.attack import Attack, Attacked, Rng, Weights
from gspure.attacks.random_pruning import FRACTION
from gspure.attacks.ranking import lowest_mask
from gspure.attacks.settings import require_share
from gspure.model.gaussians import Gaussians


def lowest_weight(model: Gaussians, _rng: Rng, weights: Weights, *, fraction: float = FRACTION) -> Attacked:
    """Remove the `fraction` (0 to 1) of the rows with the lowest ω_k, rounded to a whole number of them."""
    require_share("lowest_weight", "fraction", fraction)
    return Attacked.pruned(model, lowest_mask(weights, round(fraction * len(model))))


ATTACK = Attack("lowest_weight", lowest_weight)
