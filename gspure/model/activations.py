"""Opacities and scales as 3DGS stores them: logits and logarithms, which may be infinite."""

from typing import Any, Final

import numpy as np

from gspure.files import Float32

CERTAIN: Final = 20.0  # a logit whose opacity is 1 in float32
NOTHING: Final = -200.0  # a logit whose opacity is 0, and the logarithm of a size that is 0, in float32
LEAST_OPACITY: Final = 1e-6  # changed opacities are clipped to this and one minus this, so that their logits are finite


def sigmoid(logits: Float32) -> Float32:
    """Return 1 / (1 + exp(-x)), with full relative precision for very negative logits."""
    with np.errstate(over="ignore"):
        return np.float32(1) / (np.float32(1) + np.exp(-logits))


def logit(opacities: Any, least: float = 0.0) -> Float32:
    """Return log(α / (1 - α)) of opacities, clipped to `least` .. 1 - `least` first."""
    clipped = np.clip(np.asarray(opacities, np.float64), least, 1 - least)
    return np.asarray(np.log(clipped) - np.log1p(-clipped), np.float32)


def finite(stored: Float32) -> Float32:
    """Return logits or logarithms with finite numbers of the same meaning in place of infinities."""
    return np.asarray(np.nan_to_num(stored, nan=np.nan, posinf=CERTAIN, neginf=NOTHING))
