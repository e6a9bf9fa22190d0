"""Opacities as 3DGS stores them: logits."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

OPACITY_RANGE: Final = (1e-6, 1 - 1e-6)
"""Opacities are clipped to this, so that their logits are finite."""


def logit(opacities: NDArray[Any]) -> NDArray[np.float32]:
    """Return log(α / (1 - α)) of opacities, clipped to `OPACITY_RANGE`."""
    clipped = np.clip(np.asarray(opacities, np.float64), *OPACITY_RANGE)
    return (np.log(clipped) - np.log1p(-clipped)).astype(np.float32)
