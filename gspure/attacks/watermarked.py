"""No attack: the variant that every other one is compared with."""

from __future__ import annotations

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.model.gaussians import Gaussians


def watermarked(model: Gaussians, _rng: Rng) -> Attacked:
    """Return the model itself, byte for byte."""
    return Attacked(model, np.arange(len(model)), len(model))


ATTACK = Attack("watermarked", watermarked)
