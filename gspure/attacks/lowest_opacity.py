"""Pruning by opacity: the rows with the lowest ones (the "sequential pruning" of Splats in Splats and GS-Hider)."""

from __future__ import annotations

from gspure.attacks.attack import Attack, Attacked, Opacities, Rng
from gspure.attacks.random_pruning import FRACTION
from gspure.attacks.ranking import lowest_mask
from gspure.attacks.settings import require_share
from gspure.model.gaussians import Gaussians


def lowest_opacity(model: Gaussians, _rng: Rng, opacities: Opacities, *, fraction: float = FRACTION) -> Attacked:
    """Remove the `fraction` (0 to 1) of the rows with the lowest α_k, rounded to a whole number of them."""
    require_share("lowest_opacity", "fraction", fraction)
    return Attacked.pruned(model, lowest_mask(opacities, round(fraction * len(model))))


ATTACK = Attack("lowest_opacity", lowest_opacity)
