"""The 3-D filter of Mip-Splatting and GOF, which limits Gaussians to the sampling rate of the views."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from gspure.cameras import Camera
from gspure.cameras.camera import points_shown
from gspure.dtypes import Float64
from gspure.errors import InputError
from gspure.model import Gaussians

MARGIN: Final = 0.15
"""Extension of the image beyond its edges, as a share of its size (GOF)."""

VARIANCE: Final = 0.2
"""Of the filter, in squared pixels of the nearest view (Yu et al. 2024, Mip-Splatting)."""


def filter_sizes(model: Gaussians, cameras: Sequence[Camera]) -> Float64:
    """Return the filter's standard deviation [K] in world units, by each Gaussian's nearest view.

    A Gaussian that no view shows gets the largest of all.

    Raise `InputError` if no view shows a Gaussian.
    """
    nearest = np.full(len(model), np.inf)
    for camera in cameras:
        rows, positions = points_shown(camera, model.means, MARGIN)
        nearest[rows] = np.minimum(nearest[rows], positions[:, 2])
    visible = np.isfinite(nearest)
    if not visible.any():
        raise InputError("cameras", "views", expected="a view of the model", found="no Gaussian in any view")
    focal = max(camera.K[0, 0] for camera in cameras)
    return np.asarray(np.sqrt(VARIANCE) / focal * np.where(visible, nearest, nearest[visible].max()))


def filtered(model: Gaussians, cameras: Sequence[Camera]) -> Gaussians:
    """Return the model with its filter applied: scales s' = sqrt(s^2 + f^2), the same opacities.

    GOF, which trains with the filter, also multiplies opacities by det s / det s'. Models trained with 3DGS's dilation,
    which keeps opacities, would become transparent where their Gaussians are flat.
    """
    squared = np.square(filter_sizes(model, cameras))[:, None]
    stored = model.columns("scale_0", "scale_1", "scale_2").astype(np.float64)
    scales = 0.5 * np.logaddexp(2 * stored, np.log(squared))
    return model.with_columns({f"scale_{axis}": scales[:, axis] for axis in range(3)})
