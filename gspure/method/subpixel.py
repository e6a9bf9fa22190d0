"""Gaussians without weight because they are smaller than a pixel in every view, or nearer than the near plane."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Indices
from gspure.cameras.camera import Camera, points_shown
from gspure.constants import ALPHA_MIN, NEAR_PLANE
from gspure.model.gaussians import Gaussians
from gspure.model.rotations import principal_axes
from gspure.settings import SIDE

NEAR_SHARE: Final = 0.01  # share of rows before the near plane above which a line is printed; ours


@dataclass(frozen=True)
class Subpixel:
    """Rows [S] of weight 0 inside an image that cover less than a pixel in every view.

    At `magnification` times the width of the views, half of them would cover a pixel.
    """

    rows: Indices
    magnification: float

    def line(self, count: int, width: int) -> str:
        """Return a line of text, for a model of `count` Gaussians and views `width` pixels wide."""
        text = f"{len(self.rows)} of {count} Gaussians have weight 0 and cover less than a pixel in every view"
        wide = int(np.ceil(self.magnification * width))
        if wide > SIDE.most:
            return text
        return f"{text}; half of them would cover one in views {wide} pixels wide"


def subpixel_rows(model: Gaussians, weights: NDArray[Any], cameras: Sequence[Camera]) -> Subpixel | None:
    """Return the rows of weight 0 whose footprint, alpha >= 1/255, is smaller than a pixel in every view; else None.

    The weights are those of these views and the energy "ray": its footprints have no dilation, so they may fall between
    pixel centres. Areas are those of the linearized projection, which is exact for small Gaussians.
    """
    rows = np.flatnonzero((weights == 0) & (model.opacities >= ALPHA_MIN))
    weightless = Gaussians(model.table[rows])
    axes = principal_axes(weightless)
    means = weightless.means.astype(np.float64)
    faces = np.cross(axes[:, [1, 2, 0]], axes[:, [2, 0, 1]])  # s_b s_c q_a
    squares = 2 * np.log(np.maximum(weightless.opacities, ALPHA_MIN) / ALPHA_MIN)  # t^2
    largest = np.zeros(len(rows))
    for camera in cameras:
        shown, positions = points_shown(camera, means)
        # det(J Sigma J') = (fx fy / z^2)^2 sum_a (s_b s_c q_a . r)^2 (Cauchy-Binet), r the centre's ray, 1 deep
        depths = positions[:, 2]
        rays = (means[shown] - camera.centre) / depths[:, None]
        spread = np.linalg.norm(np.einsum("kai,ki->ka", faces[shown], rays), axis=1)
        areas = np.pi * squares[shown] * camera.K[0, 0] * camera.K[1, 1] / depths**2 * spread
        largest[shown] = np.maximum(largest[shown], areas)
    small = (largest > 0) & (largest < 1)
    if not small.any():
        return None
    magnification = float(1 / np.sqrt(np.median(largest[small])))
    return Subpixel(rows[small], magnification)


def near_lines(model: Gaussians, weights: NDArray[Any], cameras: Sequence[Camera]) -> list[str]:
    """Return a line of text if more than `NEAR_SHARE` of all rows have weight 0 and lie before a view's near plane.

    Rows behind the near plane of any view that shows them, and rows that no view shows, do not count.
    """
    count = len(model)
    rows = np.flatnonzero((weights == 0) & (model.opacities >= ALPHA_MIN))
    means = model.means[rows].astype(np.float64)
    near = np.zeros(len(rows), np.bool_)
    drawn = np.zeros(len(rows), np.bool_)
    for camera in cameras:
        near[points_shown(camera, means, near=0.0)[0]] = True
        drawn[points_shown(camera, means)[0]] = True
    hidden = int(np.count_nonzero(near & ~drawn))
    if hidden <= NEAR_SHARE * count:
        return []
    text = f"{hidden} of {count} Gaussians have weight 0 and lie between the camera and the near plane"
    advice = "if the whole scene is only a few units in size, scale up model and cameras by the same factor"
    return [f"{text} (depth {NEAR_PLANE}); {advice}"]
