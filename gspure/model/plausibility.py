"""Stored values that are hardly meant as 3DGS means them: activated ones, and coordinates too large for float32."""

from typing import Final

import numpy as np

from gspure.model.gaussians import Gaussians
from gspure.model.summary import extent_and_distances

_NEAR_ZERO: Final = 1 / 7  # of the median scale, or of 1, is above the smallest scale, if these are linear; ours
_LARGE: Final = 1 / 10  # of the extent is below the median Gaussian, if scales are linear; ours
_COARSE: Final = (1 / 20, 1 / 5000)  # largest step of coordinates: of the median Gaussian, and of the extent; ours


def doubts(model: Gaussians) -> list[str]:
    """Return what is doubtful about the stored values of Gaussians, and what to do: a line of text for each doubt."""
    rows = np.isfinite(model.means).all(axis=1) & (model.log_scales < np.inf).all(axis=1)
    if model.has_anchors or not rows.any():
        return []
    means, stored, opacities = model.means[rows], model.log_scales[rows], model.table["opacity"][rows]
    extent, _ = extent_and_distances(means.astype(np.float64))
    least, median = float(stored.min()), float(np.median(stored))
    size = float(np.exp(min(np.median(stored.max(axis=1)), 80)))
    activated = []
    if least >= 0 and (least < _NEAR_ZERO * min(median, 1) or size > _LARGE * extent):
        activated.append(f"scales of {least:.3g} to {stored.max():.3g}, where 3DGS has ln(scale)")
    if opacities.min() >= 0 and 0 < opacities.max() <= 1:
        inverse = "ln(opacity / (1 - opacity))"
        activated.append(f"opacities of {opacities.min():.3g} to {opacities.max():.3g}, where 3DGS has {inverse}")
    remedy = "apply these with gspure.read_model, with_columns and write_model"
    lines = [f"values seem to be stored activated: {'; '.join(activated)}; {remedy}"] if activated else []
    farthest = np.abs(np.median(means, axis=0)).max()
    step = float(np.spacing(farthest))
    if step > min(_COARSE[0] * size, _COARSE[1] * extent or np.inf) > 0:
        found = f"float32 steps of {step:.2g}, and the median Gaussian is {size:.2g} large: detail is lost"
        remedy = "subtract an offset from the coordinates of model and cameras before training or export"
        lines.append(f"coordinates around {farthest:.6g} have {found}; {remedy}")
    return lines
