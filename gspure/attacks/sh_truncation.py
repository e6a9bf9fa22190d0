"""Truncation of the spherical harmonics, as viewers and converters do it to save room."""

from __future__ import annotations

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.settings import require
from gspure.model.gaussians import Gaussians


def sh_truncation(model: Gaussians, _rng: Rng, *, degree: int = 0) -> Attacked:
    """Set the coefficients above `degree` to zero; the columns stay, so that every reader of the model reads it still.

    Refused where there is nothing above it: models of that degree, and those that colour by features.
    """
    most = model.sh_degree - 1
    expected = f"0 to {most}" if most >= 0 else "a model with harmonics above degree 0"
    require("sh_truncation", "degree", degree, expected, fits=0 <= degree <= most)
    rest = model.columns_named("f_rest_")
    stored = len(rest) // 3  # per channel, channel-major: number i holds coefficient 1 + i % stored
    above = [name for i, name in enumerate(rest) if 1 + i % stored >= (degree + 1) ** 2]
    return Attacked.changed(model, dict.fromkeys(above, np.zeros(len(model), np.float32)))


ATTACK = Attack("sh_truncation", sh_truncation)
