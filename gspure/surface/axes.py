"""The principal axes of Gaussians in the world."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gspure.model import Gaussians


def principal_axes(model: Gaussians) -> NDArray[np.float64]:
    """Return each Gaussian's axes, one standard deviation long: [K,3 axes,3]; NaN for a zero quaternion."""
    quats = model.quats.astype(np.float64)
    with np.errstate(invalid="ignore"):
        w, xyz = np.split(quats / np.linalg.norm(quats, axis=1, keepdims=True), [1], axis=1)
        axes = model.scales[:, :, None] * np.eye(3)
        turned = 2 * np.cross(xyz[:, None], axes)  # a unit quaternion (w, u) turns v into v + w t + u x t, t = 2 u x v
        return np.asarray(axes + w[:, None] * turned + np.cross(xyz[:, None], turned))
