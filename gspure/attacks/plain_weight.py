"""Control: the threshold on the weights alone, without clustering."""

from __future__ import annotations

from gspure.attacks.attack import Attack, Attacked, Rng, Weights
from gspure.constants import TAU_N
from gspure.model.gaussians import Gaussians
from gspure.pruning import plain_prune_mask


def plain_weight(model: Gaussians, _rng: Rng, weights: Weights, *, tau: float = TAU_N) -> Attacked:
    """Remove the rows with ω_k < ω̄ / `tau`."""
    return Attacked.pruned(model, ~plain_prune_mask(weights, tau))


ATTACK = Attack("plain_weight", plain_weight)
