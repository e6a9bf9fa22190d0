"""Attacks that add random noise to stored values."""

from typing import Final

import numpy as np

from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked, require_attribute, select_columns
from gspure.attacks.geometry import radius, warn_of_coarse_centres
from gspure.attacks.strength import Strength
from gspure.model.activations import LEAST_OPACITY, logit
from gspure.model.gaussians import Gaussians
from gspure.public_model import Columns
from gspure.settings import Amount

SIGMA: Final = 0.1  # standard deviation of attribute noise, in units of the stored values; ours: the paper names none
OPACITY_SIGMA: Final = 0.1  # relative to each opacity; ours: the middle of the published range, 0.05 to 0.2
POSITION_SIGMA: Final = 0.005  # in radii of the model; ours: the middle of the published range, 0.001 to 0.01


def gaussian_noise(
    model: Gaussians, rng: Rng, columns: Columns, *, sigma: Amount = SIGMA, attributes: str = "colour"
) -> Attacked:
    """Add independent Gaussian noise to stored attributes of every row (paper, §Intuitive Methods, 3).

    Its standard deviation `sigma` is the same for every column. Attributes are ``colour`` (spherical harmonics or
    features: the paper's "photometric features"), ``base_colour``, and ``opacity`` (the logit).
    """
    names = select_columns("gaussian_noise", columns, attributes, ("colour", "base_colour", "opacity"))
    noisy = {name: (model.table[name] + sigma * rng.standard_normal(len(model))).astype(np.float32) for name in names}
    return Attacked.changed(model, noisy)


def opacity_noise(model: Gaussians, rng: Rng, columns: Columns, *, sigma: Amount = OPACITY_SIGMA) -> Attacked:
    """Multiply every opacity by an independent 1 + `sigma` ε, ε normal; the result is clipped to 0 to 1."""
    require_attribute("opacity_noise", columns, "opacity")
    noisy = model.opacities * (1 + sigma * rng.standard_normal(len(model)))
    return Attacked.changed(model, {"opacity": logit(noisy, LEAST_OPACITY)})


def position_noise(model: Gaussians, rng: Rng, *, sigma: Amount = POSITION_SIGMA) -> Attacked:
    """Move every centre by independent Gaussian noise of `sigma` times the model's radius along each axis."""
    warn_of_coarse_centres("position_noise", model)
    moved = model.means + sigma * radius(model) * rng.standard_normal((len(model), 3))
    return Attacked.changed(model, dict(zip("xyz", moved.astype(np.float32).T, strict=True)))


ATTACKS = named(
    {
        gaussian_noise: Strength("sigma", 1e-3, 10.0, "log"),
        opacity_noise: Strength("sigma", 1e-2, 10.0, "log"),
        position_noise: Strength("sigma", 1e-5, 0.1, "log"),
    }
)
