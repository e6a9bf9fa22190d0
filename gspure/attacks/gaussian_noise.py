"""Attribute noise injection (paper, §Intuitive Methods, 3)."""

from __future__ import annotations

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.attributes import colour_columns, parse_attributes
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians

SIGMA = 0.1
"""Standard deviation of the noise, in units of the stored values. Ours: the paper names none."""


def gaussian_noise(model: Gaussians, rng: Rng, *, sigma: float = SIGMA, attributes: str = "colour") -> Attacked:
    """Add independent Gaussian noise to stored attributes of every Gaussian.

    Parameters
    ----------
    model : Gaussians
    rng : Generator
    sigma : float
        Standard deviation, at least 0, the same for every column.
    attributes : str
        ``colour`` (spherical-harmonic coefficients or features: the paper's "photometric features"), ``opacity`` (the
        logit), or ``colour,opacity``.

    """
    if not (np.isfinite(sigma) and sigma >= 0):
        raise InputError("attack gaussian_noise", "sigma", expected="a number of at least 0", found=str(sigma))
    names = parse_attributes(attributes)
    columns = (*(colour_columns(model) if "colour" in names else ()), *(("opacity",) if "opacity" in names else ()))
    changed = {
        column: (model.table[column] + sigma * rng.standard_normal(len(model))).astype(np.float32) for column in columns
    }
    return Attacked(model.with_columns(changed), np.ones(len(model), np.bool_))


ATTACK = Attack("gaussian_noise", gaussian_noise)
