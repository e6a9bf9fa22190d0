"""Stored values that are hardly meant as 3DGS means them: activated ones, and coordinates too large for float32."""

from typing import Final

import numpy as np

from gspure.model.gaussians import Gaussians
from gspure.model.summary import extent_and_distances

_SPREAD: Final = 5.0  # least ratio of the median to the smallest of scales that are taken for linear; ours
_LARGE: Final = 0.1  # median size of Gaussians, as a share of the extent, from which scales are taken for linear; ours
_COARSE: Final = (
    1 / 20,
    1 / 5000,
)  # largest step of coordinates, as shares of the median Gaussian and of the extent; ours


def doubts(model: Gaussians) -> list[str]:
    """Return what is doubtful about the stored values of Gaussians, and what to do: a line of text for each doubt."""
    rows = np.isfinite(np.column_stack([model.means, model.scales])).all(axis=1)
    if model.has_anchors or not rows.any():
        return []
    means, stored, opacities = model.means[rows], model.log_scales[rows], model.table["opacity"][rows]
    extent, _ = extent_and_distances(means.astype(np.float64))
    size, least = float(np.median(np.exp(stored.max(axis=1)))), float(stored.min())
    activated = []
    if least >= 0 and (np.median(stored) > _SPREAD * least or size > _LARGE * extent):
        activated.append(f"scales of {least:.3g} to {stored.max():.3g}, where 3DGS has ln(scale)")
    if opacities.min() >= 0 and 0 < opacities.max() <= 1:
        inverse = "ln(opacity / (1 - opacity))"
        activated.append(f"opacities of {opacities.min():.3g} to {opacities.max():.3g}, where 3DGS has {inverse}")
    remedy = "apply these with gspure.read_model, with_columns and write_model"
    lines = [f"values seem to be stored activated: {'; '.join(activated)}; {remedy}"] if activated else []
    farthest = np.abs(np.median(means, axis=0)).max()
    step = float(np.spacing(farthest))
    if step > min(_COARSE[0] * size, _COARSE[1] * extent or np.inf) > 0:
        found = f"{step:.2g}, and the median Gaussian is {size:.2g} large"
        lines.append(
            f"coordinates around {farthest:.6g} have float32 steps of {found}: "
            "detail is lost; subtract an offset from the coordinates of model and cameras before training or export"
        )
    return lines
