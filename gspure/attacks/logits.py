"""Opacities as 3DGS stores them: logits."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

LIMITS: Final = (1e-6, 1 - 1e-6)
"""Changed opacities are kept within these, so that their logits are finite."""


def logits(opacities: NDArray[Any]) -> NDArray[np.float32]:
    """Return log(α / (1 - α)) of opacities, those outside `LIMITS` taken for the nearer one."""
    inside = np.clip(np.asarray(opacities, np.float64), *LIMITS)
    return (np.log(inside) - np.log1p(-inside)).astype(np.float32)
