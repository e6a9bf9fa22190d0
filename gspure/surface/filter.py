"""The 3-D filter of Mip-Splatting and GOF: no Gaussian is smaller than what the views can sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.cameras import Camera
from gspure.cameras.projection import points_shown
from gspure.errors import InputError
from gspure.model import Gaussians

MARGIN: Final = 0.15
"""Views see this share of the image's size beyond its edges (GOF)."""

VARIANCE: Final = 0.2
"""Of the filter, in squares of a pixel's size at the nearest view (Yu et al. 2024, Mip-Splatting)."""


def filter_sizes(model: Gaussians, cameras: Sequence[Camera]) -> NDArray[np.float64]:
    """Return the filter's standard deviation [K] in world units: by each Gaussian's nearest view.

    One that no view sees gets the largest of the others'.

    Raises
    ------
    InputError
        If no view sees any.

    """
    nearest = np.full(len(model), np.inf)
    for camera in cameras:
        rows, positions = points_shown(camera, model.means, MARGIN)
        nearest[rows] = np.minimum(nearest[rows], positions[:, 2])
    seen = np.isfinite(nearest)
    if not seen.any():
        raise InputError("cameras", "views", expected="a view of the model", found="no Gaussian in any view")
    focal = max(camera.K[0, 0] for camera in cameras)
    return np.asarray(np.sqrt(VARIANCE) / focal * np.where(seen, nearest, nearest[seen].max()))


def filtered(model: Gaussians, cameras: Sequence[Camera]) -> Gaussians:
    """Return the model with its filter applied: scales s' = sqrt(s^2 + f^2), opacities as they are.

    GOF, which trains with the filter, also lowers opacities, by det s / det s'. Models that were trained with 3DGS's
    dilation, which does not, would become transparent where their Gaussians are flat.
    """
    squared = np.square(filter_sizes(model, cameras))[:, None]
    stored = model.columns("scale_0", "scale_1", "scale_2").astype(np.float64)
    scales = 0.5 * np.logaddexp(2 * stored, np.log(squared))
    return model.with_columns({f"scale_{axis}": scales[:, axis] for axis in range(3)})
