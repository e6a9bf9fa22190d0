"""Rotation matrices of quaternions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def rotation_matrices(quats: NDArray[Any]) -> NDArray[np.float64]:
    """Return the rotations [K,3,3] of quaternions (w, x, y, z) [K,4] of any norm but zero."""
    quats = np.asarray(quats, np.float64)
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)
