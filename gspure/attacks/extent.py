"""How large a model is, such that a few floaters do not decide it."""

from __future__ import annotations

from typing import Final

import numpy as np

from gspure.model.gaussians import Gaussians

INNER: Final = 0.9
"""Share of the rows that the radius reaches. Ours."""


def radius(model: Gaussians) -> float:
    """Return the distance from the median of the centres within which `INNER` of them lie, in world units."""
    if not len(model):
        return 0.0
    means = model.means.astype(np.float64)
    return float(np.quantile(np.linalg.norm(means - np.median(means, axis=0), axis=1), INNER))
