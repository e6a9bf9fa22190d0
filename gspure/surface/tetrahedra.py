"""Points around Gaussians, and the tetrahedra between them (Yu et al. 2024, Gaussian Opacity Fields)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.cameras import Camera
from gspure.cameras.projection import points_shown
from gspure.model import Gaussians
from gspure.surface.axes import principal_axes

REACH: Final = 3.0
"""Half side of the box around a Gaussian, in standard deviations (GOF)."""

_CORNERS: Final = REACH * np.array([*product((-1.0, 1.0), repeat=3)])


def box_points(model: Gaussians) -> NDArray[np.float64]:
    """Return the corners of the box around each Gaussian, 8K rows, then its centres, K more."""
    corners = _CORNERS @ principal_axes(model) + model.means[:, None]
    return np.concatenate([corners.reshape(-1, 3), model.means])


def shown(points: NDArray[np.float64], cameras: Sequence[Camera]) -> NDArray[np.bool_]:
    """Return the mask of the `points` [P,3] that any view shows."""
    mask = np.zeros(len(points), np.bool_)
    for camera in cameras:
        rest = np.flatnonzero(~mask)
        mask[rest[points_shown(camera, points[rest])[0]]] = True
    return mask


def tetrahedra(points: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the Delaunay tetrahedra [T,4] of the `points` [P,3], at least four, not all in a plane."""
    from scipy.spatial import Delaunay

    return np.asarray(Delaunay(points).simplices, np.intp)
