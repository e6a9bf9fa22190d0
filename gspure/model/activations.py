"""Opacities as 3DGS stores them: logits."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

LEAST_OPACITY: Final = 1e-6
"""Changed opacities are clipped to this and one minus this, so that their logits are finite."""


def sigmoid(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return 1 / (1 + exp(-x)), with full relative precision for very negative logits."""
    with np.errstate(over="ignore"):
        return np.float32(1) / (np.float32(1) + np.exp(-logits))


def logit(opacities: Any, least: float = 0.0) -> NDArray[np.float32]:
    """Return log(α / (1 - α)) of opacities, clipped to `least` .. 1 - `least` first."""
    clipped = np.clip(np.asarray(opacities, np.float64), least, 1 - least)
    return np.asarray(np.log(clipped) - np.log1p(-clipped), np.float32)
