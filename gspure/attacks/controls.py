"""Controls: what an attack is compared with."""

import numpy as np

from gspure.attacks.attack import Attacked, Rng, named
from gspure.attacks.pruning import TAUS, lowest_mask, random_mask
from gspure.constants import TAU_N
from gspure.dtypes import Bools, Float32
from gspure.method.pruning import plain_prune_mask
from gspure.model.gaussians import Gaussians


def unattacked(model: Gaussians, _rng: Rng) -> Attacked:
    """Return the model itself, byte for byte."""
    return Attacked(model, np.arange(len(model)), len(model))


def plain_weight(model: Gaussians, _rng: Rng, weights: Float32, *, tau: float = TAU_N) -> Attacked:
    """Remove the rows with ω_k < ω̄ / `tau`: GSPure without clusters."""
    return Attacked.without(model, plain_prune_mask(weights, tau))


def plain_opacity(model: Gaussians, _rng: Rng, opacities: Float32, *, tau: float = TAU_N) -> Attacked:
    """Remove the rows with α_k < ᾱ / `tau`."""
    return Attacked.without(model, plain_prune_mask(opacities, tau))


def random_matched(model: Gaussians, rng: Rng, prune_mask: Bools) -> Attacked:
    """Remove as many rows as GSPure does, at random."""
    return Attacked.without(model, random_mask(len(model), int(prune_mask.sum()), rng))


def lowest_weight_matched(model: Gaussians, _rng: Rng, weights: Float32, prune_mask: Bools) -> Attacked:
    """Remove as many rows as GSPure does, in ascending order of ω_k."""
    return Attacked.without(model, lowest_mask(weights, int(prune_mask.sum())))


def lowest_opacity_matched(model: Gaussians, _rng: Rng, opacities: Float32, prune_mask: Bools) -> Attacked:
    """Remove as many rows as GSPure does, in ascending order of α_k."""
    return Attacked.without(model, lowest_mask(opacities, int(prune_mask.sum())))


ATTACKS = named(
    {
        unattacked: None,
        plain_weight: TAUS,
        plain_opacity: TAUS,
        random_matched: None,
        lowest_weight_matched: None,
        lowest_opacity_matched: None,
    }
)
