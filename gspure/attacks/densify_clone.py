r"""Densification: rows that exist twice, each with less opacity.

Two Gaussians in one place with opacity :math:`\alpha'` let through as much as one with :math:`\alpha`, at their centre,
if

.. math:: (1 - \alpha')^2 = 1 - \alpha

so images change little, while every row that was chosen has another opacity and stands in the model twice.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.attributes import require_gaussians
from gspure.attacks.logits import logits
from gspure.attacks.settings import require_share
from gspure.model.gaussians import Gaussians

FRACTION: Final = 0.25
"""Share of the rows to clone. Ours."""


def densify_clone(model: Gaussians, rng: Rng, *, fraction: float = FRACTION) -> Attacked:
    """Clone a random `fraction` (0 to 1) of the rows; the clones come last, in the order of their originals."""
    require_share("densify_clone", "fraction", fraction)
    require_gaussians("densify_clone", model, "an opacity")
    count = len(model)
    chosen = np.sort(rng.choice(count, round(fraction * count), replace=False))
    rows = np.concatenate([np.arange(count), chosen])
    opacity = model.table["opacity"][rows]
    twice = np.concatenate([chosen, np.arange(count, len(rows))])
    opacity[twice] = logits(1 - np.sqrt(1 - model.opacities[rows[twice]].astype(np.float64)))
    return Attacked.taken(model, rows, {"opacity": opacity})


ATTACK = Attack("densify_clone", densify_clone)
