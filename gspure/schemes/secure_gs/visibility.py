"""Visible anchors, by the rasterizer's rule for Gaussians, as in Scaffold-GS."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.constants import EWA_DILATION, EWA_FRUSTUM_MARGIN, NEAR_PLANE, TILE
from gspure.files import Float64, Indices
from gspure.model.rotations import rotation_matrices


@np.errstate(invalid="ignore")
def visible_rows(camera: Camera, means: NDArray[Any], quats: NDArray[Any], scales: NDArray[Any]) -> Indices:
    """Return the rows of the Gaussians [M] whose three-sigma square on the screen overlaps a tile of the image.

    (Scaffold-GS, ``prefilter_voxel``; the bounds of the 3DGS rasterizer.) Rows with a zero quaternion or an infinite
    scale have none.
    """
    rotation = camera.viewmat[:3, :3]
    centres = means @ rotation.T + camera.viewmat[:3, 3]
    rows = np.flatnonzero(centres[:, 2] > NEAR_PLANE)
    centres = centres[rows]
    axes = rotation @ rotation_matrices(quats[rows]) * np.asarray(scales, np.float64)[rows, None, :]
    centres2d, radii = _bounds(camera, centres, axes)
    size = np.array([camera.width, camera.height])
    tiles = -(-size // TILE)
    first = np.clip(np.trunc((centres2d - radii) / TILE), 0, tiles)
    last = np.clip(np.trunc((centres2d + radii + TILE - 1) / TILE), 0, tiles)
    return rows[(last > first).all(axis=1)]


def _bounds(camera: Camera, centres: Float64, axes: Float64) -> tuple[Float64, Float64]:
    """Return the centres [V,2] on the screen and the radii [V,1] of Gaussians with principal `axes` [V,3,3]."""
    focal, principal = np.diag(camera.K)[:2], camera.K[:2, 2]
    size = np.array([camera.width, camera.height])
    slopes = centres[:, :2] / centres[:, 2:]
    margin = EWA_FRUSTUM_MARGIN * size / (2 * focal)
    clipped = np.clip(slopes, -principal / focal - margin, (size - principal) / focal + margin)
    # J A: the axes on the screen, J = f / z (I | -slope) of the perspective projection
    spread = (axes[:, :2] - clipped[:, :, None] * axes[:, 2:]) * (focal / centres[:, 2:])[:, :, None]
    a, b = np.square(spread).sum(axis=2).T + EWA_DILATION
    middle, determinant = (a + b) / 2, a * b - (spread[:, 0] * spread[:, 1]).sum(axis=1) ** 2
    largest = middle + np.sqrt(np.maximum(0.1, middle**2 - determinant))
    # the rasterizer samples at integer coordinates
    return slopes * focal + principal - 0.5, np.ceil(3 * np.sqrt(largest))[:, None]
