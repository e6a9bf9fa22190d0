"""Projection of points into a view."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.constants import NEAR_PLANE


def points_shown(
    camera: Camera, points: NDArray[Any], margin: float = 0.0
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the rows [S] of world `points` [P,3] in the image and behind the near plane, and their positions [S,3].

    Positions are column and row in pixels, and depth along the view axis. `margin` extends the image on every side, as
    a share of its size. A point that is not finite is not shown.
    """
    with np.errstate(invalid="ignore"):
        view = points @ camera.viewmat[:3, :3].T + camera.viewmat[:3, 3]
        behind = np.flatnonzero(view[:, 2] > NEAR_PLANE)
        x, y, z = view[behind].T
        u = camera.K[0, 0] * x / z + camera.K[0, 2]
        v = camera.K[1, 1] * y / z + camera.K[1, 2]
        left, top = margin * camera.width, margin * camera.height
        inside = (u >= -left) & (u < camera.width + left) & (v >= -top) & (v < camera.height + top)
    return behind[inside], np.stack([u, v, z], axis=1)[inside]
