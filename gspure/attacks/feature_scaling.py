"""Feature scaling (paper, §Intuitive Methods, 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.attributes import colour_columns, parse_attributes
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians

FACTOR = 1.2
"""Scale of the features. Ours: the paper says "amplifies", without a value."""

OPACITY_LIMITS = (1e-6, 1 - 1e-6)
"""A scaled opacity is kept within these, so that its logit is finite."""


def feature_scaling(model: Gaussians, _rng: Rng, *, factor: float = FACTOR, attributes: str = "colour") -> Attacked:
    """Multiply the attributes of every Gaussian by `factor`.

    Parameters
    ----------
    model : Gaussians
    factor : float
        At least 0.
    attributes : str
        ``colour`` (the stored coefficients or features), ``opacity`` (the activated one), or ``colour,opacity``. The
        paper scales both in §Intuitive Methods, and colour alone in §Baselines, which is the default here.

    """
    if not (np.isfinite(factor) and factor >= 0):
        raise InputError("attack feature_scaling", "factor", expected="a number of at least 0", found=str(factor))
    changed: dict[str, NDArray[np.float32]] = {}
    names = parse_attributes(attributes)
    if "colour" in names:
        changed |= {column: model.table[column] * np.float32(factor) for column in colour_columns(model)}
    if "opacity" in names:
        opacities = np.clip(model.opacities.astype(np.float64) * factor, *OPACITY_LIMITS)
        changed["opacity"] = (np.log(opacities) - np.log1p(-opacities)).astype(np.float32)
    return Attacked(model.with_columns(changed), np.ones(len(model), np.bool_))


ATTACK = Attack("feature_scaling", feature_scaling)
