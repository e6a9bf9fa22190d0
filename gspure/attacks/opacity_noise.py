"""Noise on the opacities, relative to each."""

from __future__ import annotations

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.attributes import require_gaussians
from gspure.attacks.logits import logits
from gspure.attacks.settings import require_size
from gspure.model.gaussians import Gaussians

SIGMA = 0.1
"""Standard deviation, as a share of the opacity. Ours: the middle of the published range, 0.05 to 0.2."""


def opacity_noise(model: Gaussians, rng: Rng, *, sigma: float = SIGMA) -> Attacked:
    """Multiply every opacity by an independent 1 + `sigma` ε, ε normal; those that leave 0 to 1 are clipped."""
    require_size("opacity_noise", "sigma", sigma)
    require_gaussians("opacity_noise", model, "an opacity")
    return Attacked.changed(model, {"opacity": logits(model.opacities * (1 + sigma * rng.standard_normal(len(model))))})


ATTACK = Attack("opacity_noise", opacity_noise)
