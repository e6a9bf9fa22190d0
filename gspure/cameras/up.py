"""The up direction of a model that comes without cameras."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

_COLMAP = np.array([0.0, -1.0, 0.0])  # y points down, and 3DGS models use COLMAP's world
_FLAT = 0.8  # largest ratio of the smallest to the second deviation for which a model counts as flat. Ours
_UPRIGHT = 0.94  # cosine of 20 degrees: nearer axes are taken as they are. Ours
_NEUTRAL = 1e-6  # a normal with less of -y + z has no sense. Ours


def guessed_up(points: Float64, weights: NDArray[Any]) -> Float64:
    """Return the unit vector [3] normal to the plane in which a model extends: its ground, or that of a flat object.

    Its sense is that of the usual worlds, -y or +z up. A direction near an axis is that axis. It is -y, as from COLMAP,
    if the model is not flat or its plane is upright in both worlds. Points [K,3] are finite; their weights [K] may be
    opacities.
    """
    weights = weights + np.finfo(np.float64).tiny  # some may be invisible, but not all
    offsets = points - np.average(points, axis=0, weights=weights)
    variances, axes = np.linalg.eigh((offsets * weights[:, None]).T @ offsets)
    sense = axes[:, 0] @ (0, -1, 1)
    normal = axes[:, 0] * np.sign(sense)
    is_flat, is_neutral = variances[0] < _FLAT**2 * variances[1], abs(sense) < _NEUTRAL
    if not is_flat or is_neutral or abs(normal[0]) > max(-normal[1], normal[2]):
        return _COLMAP
    nearest = np.round(normal * (np.abs(normal) > _UPRIGHT))
    return np.asarray(nearest if nearest.any() else normal)
