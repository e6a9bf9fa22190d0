"""The 3-D filter of Mip-Splatting and GOF: a smoothing of each Gaussian, stored beside its scales and opacity.

Source: Yu et al., Mip-Splatting: Alias-free 3D Gaussian Splatting, CVPR 2024, equation 9.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.files import Float32, Float64
from gspure.model.activations import LEAST_OPACITY, logit
from gspure.model.gaussians import SCALES, Gaussians

FILTER: Final = "filter_3D"  # column of its standard deviation, world units


def filtered(model: Gaussians) -> Gaussians:
    """Return a model whose scales and opacities include its filter, which becomes 0; without one, the model itself.

    The filter adds its variance to that of each axis, and lowers the opacity by the ratio of the volumes. Programs that
    apply filters draw both models in the same way.
    """
    if FILTER not in model.names or not model.table[FILTER].any():
        return model
    sizes = model.columns(FILTER)[:, 0]
    rows = np.flatnonzero((sizes != 0) & (model.opacities > 0))
    scales, opacity = model.log_scales, model.columns("opacity")[:, 0]
    wider = widened(scales[rows], sizes[rows])
    shares = np.exp((scales[rows] - wider).sum(axis=1))
    scales[rows], opacity[rows] = wider, logit(model.opacities[rows] * shares, LEAST_OPACITY)
    values = dict(zip(SCALES, scales.T, strict=True)) | {"opacity": opacity, FILTER: np.zeros(len(model))}
    return model.with_columns(values)


def widened(log_scales: Float32, sizes: NDArray[Any]) -> Float64:
    """Return log(sqrt(s^2 + f^2)) of the scales s [K,3] of Gaussians and the standard deviations f [K] of filters."""
    variances = np.square(sizes, dtype=np.float64)[:, None]
    return np.asarray(np.logaddexp(2 * log_scales.astype(np.float64), np.log(variances)) / 2)
