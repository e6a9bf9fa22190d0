"""Control: the same threshold on the opacities, which need no rendering to be known."""

from __future__ import annotations

from gspure.attacks.attack import Attack, Attacked, Opacities, Rng
from gspure.constants import TAU_N
from gspure.model.gaussians import Gaussians
from gspure.pruning import plain_prune_mask


def plain_opacity(model: Gaussians, _rng: Rng, opacities: Opacities, *, tau: float = TAU_N) -> Attacked:
    """Remove the rows with α_k < ᾱ / `tau`."""
    return Attacked.pruned(model, ~plain_prune_mask(opacities, tau))


ATTACK = Attack("plain_opacity", plain_opacity)
