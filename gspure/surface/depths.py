"""Distances of rows from the visible surface, by median depth; for rows that are not Gaussians, too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.cameras import Camera
from gspure.cameras.projection import points_shown
from gspure.opencl.device import Device, choose_device
from gspure.progress import track
from gspure.public_model import PublicModel
from gspure.renderer import Renderer
from gspure.surface.axes import principal_axes

INVISIBLE: Final = np.finfo(np.float32).max
"""Distance of rows that no view shows; files hold no infinities."""


def depth_distances(
    public: PublicModel, cameras: Sequence[Camera], device: Device | None = None
) -> NDArray[np.float32]:
    """Return the distance [K] of each row from the surface, in standard deviations along the view axis.

    It is the minimum over the views and the row's Gaussians of |z - median depth of the pixel| / deviation. A row that
    no view shows gets `INVISIBLE`.
    """
    device = device or choose_device()
    nearest = np.full(len(public.model), INVISIBLE, np.float32)
    renderer = None
    for camera in track(cameras, "median depth"):
        gaussians, rows = public.gaussians(camera)
        if renderer is None or renderer.model is not gaussians:
            renderer, axes = Renderer(gaussians, device), principal_axes(gaussians)
        deviations = np.linalg.norm(axes @ camera.viewmat[2, :3], axis=1)
        visible, positions = points_shown(camera, gaussians.means)
        columns, lines = positions[:, :2].astype(np.intp).T
        surface = renderer.depth(camera)[lines, columns]
        with np.errstate(divide="ignore", invalid="ignore"):  # Gaussians without rotation or size
            distances = np.abs(positions[:, 2] - surface) / deviations[visible]
        np.minimum.at(nearest, rows[visible], np.fmin(distances, INVISIBLE))
    return nearest
