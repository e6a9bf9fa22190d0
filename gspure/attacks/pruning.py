"""Attacks that remove rows: GSPure and others, and the controls that they are compared with."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools, Float32, Int32
from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked
from gspure.attacks.strength import Strength
from gspure.constants import ALPHA_MIN, TAU_C, TAU_N
from gspure.method import pruning
from gspure.method.pruning import plain_prune_mask
from gspure.model.gaussians import Gaussians
from gspure.settings import Amount, Factor, Share

FRACTION: Final = 0.25  # fraction of the rows to remove; ours: the paper says "a certain ratio"
SHARE: Final = 0.002  # of the weight of all rows; ours: it costs a good model of 100,000 rows 2 dB, τ = 4 costs it 9 dB
FRACTIONS: Final = Strength("fraction", 0.0, 1.0)
TAUS: Final = Strength("tau", 10_000.0, 0.01, "log")
TOLERANCE: Final = 3.0  # scales from the surface; ours: the paper does not say how GOF decides what to remove


def gspure(model: Gaussians, _rng: Rng, prune_mask: Bools) -> Attacked:
    """Remove the rows that GSPure decided on (`gspure.method.pruning.prune_mask`).

    Source: the GSPure paper.
    """
    return Attacked.without(model, prune_mask)


def gspure_scaled(
    model: Gaussians,
    _rng: Rng,
    weights: Float32,
    labels: Int32,
    *,
    scale: Factor = 1.0,
    tau_c: Factor = TAU_C,
    tau_n: Factor = TAU_N,
) -> Attacked:
    """Remove the rows that GSPure decides on with both pruning factors multiplied by `scale`: GSPure's strength.

    `tau_c` is the factor for clusters, `tau_n` that for all other rows.

    Source: the GSPure paper; `scale` is ours.
    """
    return Attacked.without(model, pruning.prune_mask(labels, weights, scale * tau_c, scale * tau_n))


def random_pruning(model: Gaussians, rng: Rng, *, fraction: Share = FRACTION) -> Attacked:
    """Remove a random `fraction` (0 to 1) of the rows, rounded to a whole number.

    Source: the GSPure paper, §Intuitive Methods, 1, which does not state the fraction; the default is ours.
    """
    return Attacked.without(model, random_mask(len(model), round(fraction * len(model)), rng))


def lowest_weight(model: Gaussians, _rng: Rng, weights: Float32, *, fraction: Share = FRACTION) -> Attacked:
    """Remove the `fraction` (0 to 1) of the rows with the lowest weights ω, rounded to a whole number.

    Source: what editors and converters do.
    """
    return Attacked.without(model, lowest_mask(weights, round(fraction * len(model))))


def weight_share(model: Gaussians, _rng: Rng, weights: Float32, *, share: Share = SHARE) -> Attacked:
    """Remove the rows with the lowest weights ω that together hold at most a `share` (0 to 1) of all weight.

    Source: ours.
    """
    held = np.cumsum(np.sort(weights), dtype=np.float64)
    removed = int(np.searchsorted(held, share * held.max(initial=0.0), "right"))
    return Attacked.without(model, lowest_mask(weights, removed))


def lowest_opacity(model: Gaussians, _rng: Rng, opacities: Float32, *, fraction: Share = FRACTION) -> Attacked:
    """Remove the `fraction` (0 to 1) of the rows with the lowest opacities, rounded to a whole number.

    Source: the "sequential pruning" of Splats in Splats and GS-Hider.
    """
    return Attacked.without(model, lowest_mask(opacities, round(fraction * len(model))))


def opacity_weight(
    model: Gaussians, _rng: Rng, weights: Float32, opacities: Float32, *, tau: Factor = TAU_N
) -> Attacked:
    """Remove the rows whose weight ω, or opacity, is below its mean over the rows, divided by `tau`.

    Source: an ablation of the GSPure paper, which does not say how it joins the two conditions; "or" is ours.
    """
    return Attacked.without(model, plain_prune_mask(opacities, tau) | plain_prune_mask(weights, tau))


def gof(model: Gaussians, _rng: Rng, surface: Float32, *, tolerance: Amount = TOLERANCE) -> Attacked:
    """Remove the rows farther than `tolerance` of their own scales from the visible surface.

    A tolerance below 1.2 removes the surface itself.

    Source: the GSPure paper, which does not say how its baseline removes rows; the rule and its default are ours.
    """
    return Attacked.without(model, ~(surface <= tolerance))


def unattacked(model: Gaussians, _rng: Rng) -> Attacked:
    """Return the model itself, byte for byte; all drops are measured from it.

    Source: ours, for comparison.
    """
    return Attacked(model, np.arange(len(model)), len(model))


def transparent(model: Gaussians, _rng: Rng, opacities: Float32) -> Attacked:
    """Remove the rows with opacities below 1/255, which no view shows.

    Source: what editors and converters do.
    """
    return Attacked.without(model, opacities < ALPHA_MIN)


def plain_weight(model: Gaussians, _rng: Rng, weights: Float32, *, tau: Factor = TAU_N) -> Attacked:
    """Remove the rows whose weight ω is below the mean weight divided by `tau`: GSPure without clusters.

    Source: ours, for comparison.
    """
    return Attacked.without(model, plain_prune_mask(weights, tau))


def plain_opacity(model: Gaussians, _rng: Rng, opacities: Float32, *, tau: Factor = TAU_N) -> Attacked:
    """Remove the rows whose opacity is below the mean opacity divided by `tau`.

    Source: ours, for comparison.
    """
    return Attacked.without(model, plain_prune_mask(opacities, tau))


def random_matched(model: Gaussians, rng: Rng, prune_mask: Bools) -> Attacked:
    """Remove as many rows as GSPure does, at random.

    Source: ours, for comparison.
    """
    return Attacked.without(model, random_mask(len(model), int(prune_mask.sum()), rng))


def lowest_weight_matched(model: Gaussians, _rng: Rng, weights: Float32, prune_mask: Bools) -> Attacked:
    """Remove as many rows as GSPure does, in ascending order of weights ω.

    Source: ours, for comparison.
    """
    return Attacked.without(model, lowest_mask(weights, int(prune_mask.sum())))


def lowest_opacity_matched(model: Gaussians, _rng: Rng, opacities: Float32, prune_mask: Bools) -> Attacked:
    """Remove as many rows as GSPure does, in ascending order of opacities.

    Source: ours, for comparison.
    """
    return Attacked.without(model, lowest_mask(opacities, int(prune_mask.sum())))


def random_mask(count: int, removed: int, rng: Rng) -> Bools:
    """Return a mask [count] that is true at exactly `removed` random places; masks of one seed are nested."""
    mask = np.zeros(count, np.bool_)
    mask[rng.permutation(count)[:removed]] = True
    return mask


def lowest_mask(values: NDArray[Any], removed: int) -> Bools:
    """Return a mask [K] that is true at exactly the `removed` lowest `values` [K]; of equals, earlier rows first."""
    mask = np.zeros(len(values), np.bool_)
    mask[np.argsort(values, kind="stable")[:removed]] = True
    return mask


ATTACKS = named(
    {
        unattacked: None,
        plain_weight: TAUS,
        plain_opacity: TAUS,
        random_matched: None,
        lowest_weight_matched: None,
        lowest_opacity_matched: None,
        gspure: None,
        gspure_scaled: Strength("scale", 10_000.0, 0.01, "log", sweep="gspure"),
        random_pruning: FRACTIONS,
        gof: Strength("tolerance", 100.0, 0.01, "log"),
        opacity_weight: TAUS,
        lowest_weight: FRACTIONS,
        weight_share: Strength("share", 1e-6, 1.0, "log"),
        lowest_opacity: FRACTIONS,
        transparent: None,
    }
)
