"""Distances of Gaussians from a mesh."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.model import Gaussians
from gspure.model.mesh import Mesh

SPLITS: Final = 8
"""Largest number of parts into which a side of a face is divided. Ours."""


def mesh_distances(model: Gaussians, mesh: Mesh) -> NDArray[np.float32]:
    """Return the distance [K] of each centre from the mesh, in units of the Gaussian's largest scale."""
    from scipy.spatial import KDTree

    distances, _ = KDTree(face_points(mesh)).query(model.means)
    return np.asarray(distances / model.scales.max(axis=1), np.float32)


def face_points(mesh: Mesh) -> NDArray[np.float64]:
    """Return points on all faces, corners included, with a spacing of at most the median of the longest sides.

    Faces larger than `SPLITS` times that size have a larger spacing.
    """
    corners = mesh.corners
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.ceil(longest / max(np.median(longest), np.finfo(np.float64).tiny)).clip(1, SPLITS)
    points = []
    for count in range(1, SPLITS + 1):
        i, j = np.indices((count + 1, count + 1)).reshape(2, -1)
        grid = np.stack([i, j, count - i - j], axis=1)[i + j <= count] / count
        points.append(np.einsum("gc,fcx->fgx", grid, corners[parts == count]).reshape(-1, 3))
    return np.concatenate(points)
