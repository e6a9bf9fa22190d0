"""Opacity at points in space (Yu et al. 2024, Gaussian Opacity Fields), one Gaussian at a time."""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64
from gspure.cameras.camera import Camera
from gspure.constants import ALPHA_MAX, ALPHA_MIN, NEAR_PLANE
from gspure.model.gaussians import Gaussians
from tests.camera_cases import project as pixels_and_depths
from tests.reference.projection import Rays, pixel_rays, project


def opacity_field(model: Gaussians, cameras: Sequence[Camera], points: NDArray[Any]) -> Float64:
    """Return the least opacity [P] of the `points` [P,3] in any view; 1 for a point that no view shows."""
    return np.asarray(np.min([opacities_at(model, camera, points)[0] for camera in cameras], axis=0))


def opacities_at(model: Gaussians, camera: Camera, points: NDArray[Any]) -> tuple[Float64, Float64]:
    """Return a view's opacity at each point, and the relative distance to the next step (0: on it, inf: none).

    Steps are the cut-off of alpha and the near plane. The opacity of a point that the view does not show is 1.
    """
    projected = cast("Rays", project(model, camera, "ray"))
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels, depths = pixels_and_depths(camera, np.asarray(points, np.float64))
    shown = (depths > NEAR_PLANE) & (pixels >= 0).all(axis=1) & (pixels < [camera.width, camera.height]).all(axis=1)
    transmittance, margins = np.ones(shown.sum()), np.full(len(shown), np.inf)
    rays = pixel_rays(camera.K, *pixels[shown].T)
    for i in range(len(projected.rows)):
        distances, peaks, squared = projected.approach(i, rays)
        distances += squared * np.maximum(peaks - depths[shown], 0.0) ** 2
        alpha = np.minimum(ALPHA_MAX, projected.opacities[i] * np.exp(-0.5 * distances))
        steps = np.minimum(np.abs(alpha / ALPHA_MIN - 1), np.abs(peaks / NEAR_PLANE - 1))
        margins[shown] = np.minimum(margins[shown], steps)
        transmittance *= 1 - np.where((alpha >= ALPHA_MIN) & (peaks > NEAR_PLANE), alpha, 0.0)
    opacities = np.ones(len(shown))
    opacities[shown] = 1 - transmittance
    return opacities, margins
