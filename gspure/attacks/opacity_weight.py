"""Ablation: the thresholds on opacity and weight together, without clustering."""

from __future__ import annotations

from gspure.attacks.attack import Attack, Attacked, Opacities, Rng, Weights
from gspure.constants import TAU_N
from gspure.model.gaussians import Gaussians
from gspure.pruning import plain_prune_mask


def opacity_weight(
    model: Gaussians, _rng: Rng, weights: Weights, opacities: Opacities, *, tau: float = TAU_N
) -> Attacked:
    """Remove the rows with α_k < ᾱ / `tau` or ω_k < ω̄ / `tau`. Ours: the paper does not say how it joins the two."""
    return Attacked.pruned(model, ~(plain_prune_mask(opacities, tau) | plain_prune_mask(weights, tau)))


ATTACK = Attack("opacity_weight", opacity_weight)
