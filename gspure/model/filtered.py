"""The 3-D filter of Mip-Splatting and GOF: a smoothing of each Gaussian, stored beside its scales and opacity.

Source: Yu et al., Mip-Splatting: Alias-free 3D Gaussian Splatting, CVPR 2024, equation 9.
"""

from typing import Final

import numpy as np

from gspure.model.activations import LEAST_OPACITY, logit
from gspure.model.gaussians import Gaussians

FILTER: Final = "filter_3D"  # column of its standard deviation, world units
_SCALES: Final = ("scale_0", "scale_1", "scale_2")


def filtered(model: Gaussians) -> Gaussians:
    """Return a model whose scales and opacities include its filter, which becomes 0; without one, the model itself.

    The filter adds its variance to that of each axis, and lowers the opacity by the ratio of the volumes. Programs that
    apply filters draw both models in the same way.
    """
    if FILTER not in model.names or not model.table[FILTER].any():
        return model
    variances = np.exp(2 * model.columns(*_SCALES).astype(np.float64))
    added = model.columns(FILTER)[:, 0].astype(np.float64) ** 2
    rows = np.flatnonzero((added > 0) & (model.opacities > 0))
    wider = variances[rows] + added[rows, None]
    values = dict(zip(_SCALES, model.columns(*_SCALES).T, strict=True)) | {"opacity": model.columns("opacity")[:, 0]}
    for name, variance in zip(_SCALES, wider.T, strict=True):
        values[name][rows] = np.log(variance) / 2
    opacities = model.opacities[rows] * np.sqrt((variances[rows] / wider).prod(axis=1))
    values["opacity"][rows] = logit(opacities, LEAST_OPACITY)
    return model.with_columns({**values, FILTER: np.zeros(len(model))})
