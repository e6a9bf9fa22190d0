"""Attribute noise injection (paper, §Intuitive Methods, 3)."""

from __future__ import annotations

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.attributes import columns_of
from gspure.attacks.settings import require_size
from gspure.model.gaussians import Gaussians

SIGMA = 0.1
"""Standard deviation of the noise, in units of the stored values. Ours: the paper names none."""


def gaussian_noise(model: Gaussians, rng: Rng, *, sigma: float = SIGMA, attributes: str = "colour") -> Attacked:
    """Add independent Gaussian noise to stored attributes of every row.

    Parameters
    ----------
    model : Gaussians
    rng : Generator
    sigma : float
        Standard deviation, at least 0, the same for every column.
    attributes : str
        Of ``colour`` (spherical-harmonic coefficients or features: the paper's "photometric features"),
        ``base_colour``, and ``opacity`` (the logit).

    """
    require_size("gaussian_noise", "sigma", sigma)
    columns = columns_of(model, attributes, ("colour", "base_colour", "opacity"))
    changed = {
        name: (model.table[name] + sigma * rng.standard_normal(len(model))).astype(np.float32) for name in columns
    }
    return Attacked.changed(model, changed)


ATTACK = Attack("gaussian_noise", gaussian_noise)
