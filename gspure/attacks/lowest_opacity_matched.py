"""Control: as many rows as GSPure prunes, but those with the lowest opacities."""

from __future__ import annotations

from gspure.attacks.attack import Attack, Attacked, Mask, Opacities, Rng
from gspure.attacks.ranking import lowest_mask
from gspure.model.gaussians import Gaussians


def lowest_opacity_matched(model: Gaussians, _rng: Rng, opacities: Opacities, prune_mask: Mask) -> Attacked:
    """Remove as many rows as GSPure's mask does, in ascending order of α_k."""
    return Attacked.pruned(model, lowest_mask(opacities, int(prune_mask.sum())))


ATTACK = Attack("lowest_opacity_matched", lowest_opacity_matched)
