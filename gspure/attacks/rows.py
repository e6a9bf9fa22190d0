r"""Attacks that copy, add or reorder rows.

`densify_clone` replaces a Gaussian of opacity :math:`\alpha` by two in the same place with opacity :math:`\alpha'`.
They transmit as much at their centre if

.. math:: (1 - \alpha')^2 = 1 - \alpha

so images change little, while every chosen row has another opacity and occurs twice.
"""

from typing import Final

import numpy as np

from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked, require_attribute
from gspure.attacks.geometry import radius
from gspure.attacks.strength import Strength
from gspure.model.activations import LEAST_OPACITY, logit
from gspure.model.gaussians import Gaussians
from gspure.public_model import Columns
from gspure.settings import Share

CLONED: Final = 0.25  # fraction of the rows to clone; ours
INJECTED: Final = 0.1  # new rows, as a fraction of the old; ours: the middle of the published range, 0.05 to 0.3
DISTANCE: Final = 0.02  # standard deviation of an injected row's offset along each axis, in radii of the model; ours


def densify_clone(model: Gaussians, rng: Rng, columns: Columns, *, fraction: Share = CLONED) -> Attacked:
    """Clone a random `fraction` (0 to 1) of the rows; the clones come last, in the order of their originals."""
    require_attribute("densify_clone", columns, "opacity")
    count = len(model)
    chosen = np.sort(rng.choice(count, round(fraction * count), replace=False))
    rows = np.concatenate([np.arange(count), chosen])
    opacity = model.table["opacity"][rows]
    doubled = np.concatenate([chosen, np.arange(count, len(rows))])
    opacity[doubled] = logit(1 - np.sqrt(1 - model.opacities[rows[doubled]].astype(np.float64)), LEAST_OPACITY)
    return Attacked.copied(model, rows, {"opacity": opacity})


def inject(model: Gaussians, rng: Rng, *, fraction: Share = INJECTED) -> Attacked:
    """Append copies of a random `fraction` (0 to 1) of the rows, each moved a little."""
    count = len(model)
    chosen = rng.choice(count, round(fraction * count), replace=False)
    rows = np.concatenate([np.arange(count), chosen])
    means = model.means[rows]
    means[count:] += DISTANCE * radius(model) * rng.standard_normal((len(chosen), 3))
    return Attacked.copied(model, rows, dict(zip("xyz", means.T, strict=True)))


def reorder(model: Gaussians, rng: Rng) -> Attacked:
    """Shuffle the rows; no image depends on their order."""
    return Attacked.copied(model, rng.permutation(len(model)))


ATTACKS = named({densify_clone: Strength("fraction", 0.0, 1.0), inject: Strength("fraction", 0.0, 1.0), reorder: None})
