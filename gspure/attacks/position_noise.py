"""Noise on the centres."""

from __future__ import annotations

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.extent import radius
from gspure.attacks.settings import require_size
from gspure.model.gaussians import Gaussians

SIGMA = 0.005
"""Standard deviation, as a share of the model's radius. Ours: the middle of the published range, 0.001 to 0.01."""


def position_noise(model: Gaussians, rng: Rng, *, sigma: float = SIGMA) -> Attacked:
    """Move every centre by independent Gaussian noise of `sigma` times the model's radius along each axis."""
    require_size("position_noise", "sigma", sigma)
    moved = model.means + sigma * radius(model) * rng.standard_normal((len(model), 3))
    return Attacked.changed(model, dict(zip("xyz", moved.astype(np.float32).T, strict=True)))


ATTACK = Attack("position_noise", position_noise)
