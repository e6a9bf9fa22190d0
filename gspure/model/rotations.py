"""Rotation matrices of quaternions, and principal axes of Gaussians."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.files import Float64
from gspure.model.gaussians import Gaussians


def rotation_matrices(quats: NDArray[Any]) -> Float64:
    """Return the rotations [K,3,3] of quaternions (w, x, y, z) [K,4] of any norm but zero."""
    quats = np.asarray(quats, np.float64)
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def principal_axes(model: Gaussians) -> Float64:
    """Return each Gaussian's axes, one standard deviation long: [K,3 axes,3]; NaN for a zero quaternion."""
    quats = model.quats.astype(np.float64)
    with np.errstate(invalid="ignore"):
        w, xyz = np.split(quats / np.linalg.norm(quats, axis=1, keepdims=True), [1], axis=1)
        axes = model.scales[:, :, None] * np.eye(3)
        turned = 2 * np.cross(xyz[:, None], axes)  # a unit quaternion (w, u) turns v into v + w t + u x t, t = 2 u x v
        return np.asarray(axes + w[:, None] * turned + np.cross(xyz[:, None], turned))
