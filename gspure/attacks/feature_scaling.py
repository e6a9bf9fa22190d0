"""Feature scaling (paper, §Intuitive Methods, 2)."""

from __future__ import annotations

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.attributes import columns_of
from gspure.attacks.logits import logits
from gspure.attacks.settings import require_size
from gspure.model.gaussians import Gaussians

FACTOR = 1.2
"""Scale of the features. Ours: the paper says "amplifies", without a value."""


def feature_scaling(model: Gaussians, _rng: Rng, *, factor: float = FACTOR, attributes: str = "colour") -> Attacked:
    """Multiply attributes of every row by `factor`.

    Parameters
    ----------
    model : Gaussians
    factor : float
        At least 0.
    attributes : str
        Of ``colour`` (the stored coefficients or features), ``base_colour``, and ``opacity`` (the activated one). The
        paper scales both in §Intuitive Methods, and colour alone in §Baselines, which is the default here.

    """
    require_size("feature_scaling", "factor", factor)
    columns = columns_of(model, attributes, ("colour", "base_colour", "opacity"))
    changed = {name: model.table[name] * np.float32(factor) for name in columns}
    if "opacity" in changed:
        changed["opacity"] = logits(model.opacities.astype(np.float64) * factor)
    return Attacked.changed(model, changed)


ATTACK = Attack("feature_scaling", feature_scaling)
