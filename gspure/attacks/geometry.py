r"""Attacks that crop, move, copy or reorder the rows.

`densify_clone` replaces a Gaussian of opacity :math:`\alpha` by two in the same place with opacity :math:`\alpha'`.
They transmit as much at their centre if

.. math:: (1 - \alpha')^2 = 1 - \alpha

so images change little, while every chosen row has another opacity and occurs twice.
"""

from typing import Annotated, Final

import numpy as np

from gspure.arrays import Float64
from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked, require, require_attribute
from gspure.attacks.strength import Strength
from gspure.cameras.camera import rigid
from gspure.model.gaussians import LEAST_OPACITY, Gaussians, logit
from gspure.model.rotations import moved, rotation
from gspure.public_model import Columns
from gspure.settings import Amount, Factor, Range, Share

CROPPED: Final = 0.5  # side of the box, relative to the model's; ours
FLOATERS: Final = 0.01  # fraction of the centres beyond the model's box, at either end of each axis; ours
INNER: Final = 0.9  # fraction of the rows within the radius; ours
FARTHEST: Final = 1e4  # largest translation in radii: there, float32 rounds centres to a thousandth of the radius; ours
CLONED: Final = 0.25  # fraction of the rows to clone; ours
INJECTED: Final = 0.1  # new rows, as a fraction of the old; ours: the middle of the published range, 0.05 to 0.3
DISTANCE: Final = 0.02  # standard deviation of an injected row's offset along each axis, in radii of the model; ours

BESIDE: Final = 3.0  # distance of a merged scene, in radii of the model: none is inside the other; ours


def crop(model: Gaussians, _rng: Rng, *, fraction: Share = CROPPED) -> Attacked:
    """Keep the rows in a box around the median of the centres, `fraction` (0 to 1) of the model's along each axis.

    The model's box spans the 1st to 99th percentiles of its centres.

    Source: what editors and converters do.
    """
    means = model.means.astype(np.float64)
    low, median, high = np.quantile(means, [FLOATERS, 0.5, 1 - FLOATERS], axis=0)
    inside = (means >= median + fraction * (low - median)) & (means <= median + fraction * (high - median))
    return Attacked.without(model, ~inside.all(axis=1))


def rigid_transform(
    model: Gaussians,
    _rng: Rng,
    columns: Columns,
    *,
    angle: Annotated[float, Range(-3600.0, 3600.0)] = 30.0,
    axis: str = "0,1,0",
    translation: str = "0,0,0",
    scale: Factor = 1.0,
) -> Attacked:
    """Rotate the model about an axis through the world's origin, then scale and translate it.

    `angle` is in degrees. `axis` and `translation` are three numbers, separated by commas: the axis of any length but
    zero, the translation in radii of the model, at most 10,000 along each coordinate. `scale` is a factor.

    The model looks the same from views that move with it (`gspure.model.rotations`). Anchors cannot be rotated: their
    networks read the viewing direction in world coordinates.

    Source: what editors and converters do.
    """
    direction = _vector("axis", axis)
    shift = _vector("translation", translation)
    length = float(np.linalg.norm(direction))
    require("rigid_transform", "axis", axis, "an axis", fits=length > 0)
    near = bool((np.abs(shift) <= FARTHEST).all())
    require("rigid_transform", "translation", translation, f"at most {FARTHEST:.0f} radii (float32)", fits=near)
    shift *= radius(model)
    rotvec = direction / length * np.deg2rad(angle)
    if angle:
        require_attribute("rigid_transform", columns, "rotation")
    transform = rigid(scale * rotation(rotvec), shift)
    return Attacked(moved(model, rotvec, shift, scale), np.arange(len(model)), len(model), transform)


def densify_clone(model: Gaussians, rng: Rng, columns: Columns, *, fraction: Share = CLONED) -> Attacked:
    """Clone a random `fraction` (0 to 1) of the rows; row and clone get the opacity 1 - sqrt(1 - opacity).

    Images change little. The clones come last, in the order of their originals.

    Source: what editors and converters do.
    """
    require_attribute("densify_clone", columns, "opacity")
    count = len(model)
    chosen = np.sort(rng.choice(count, round(fraction * count), replace=False))
    rows = np.concatenate([np.arange(count), chosen])
    opacity = model.table["opacity"][rows]
    doubled = np.concatenate([chosen, np.arange(count, len(rows))])
    opacity[doubled] = logit(1 - np.sqrt(1 - model.opacities[rows[doubled]].astype(np.float64)), LEAST_OPACITY)
    return Attacked.copied(model, rows, {"opacity": opacity})


def inject(model: Gaussians, rng: Rng, *, fraction: Share = INJECTED) -> Attacked:
    """Append copies of a random `fraction` (0 to 1) of the rows, each moved by noise of 0.02 radii along each axis.

    Source: published tests of watermarks, with a `fraction` of 0.05 to 0.3.
    """
    count = len(model)
    chosen = rng.choice(count, round(fraction * count), replace=False)
    rows = np.concatenate([np.arange(count), chosen])
    means = model.means[rows]
    means[count:] += DISTANCE * radius(model) * rng.standard_normal((len(chosen), 3))
    return Attacked.copied(model, rows, dict(zip("xyz", means.T, strict=True)))


def merge(model: Gaussians, rng: Rng, *, distance: Amount = BESIDE) -> Attacked:
    """Append another scene, `distance` radii along x: the model's rows with shuffled centres, so without a message.

    Source: what editors and converters do.
    """
    count = len(model)
    rows = np.append(np.arange(count), rng.permutation(count))
    means = np.concatenate([model.means, model.means + np.array([distance * radius(model), 0, 0])]).astype(np.float32)
    return Attacked.copied(model, rows, dict(zip("xyz", means.T, strict=True)))


def reorder(model: Gaussians, rng: Rng) -> Attacked:
    """Shuffle the rows; images depend on their order only where depths are equal.

    Source: published tests of watermarks.
    """
    return Attacked.copied(model, rng.permutation(len(model)))


def radius(model: Gaussians) -> float:
    """Return the distance from the median of the centres that holds `INNER` of them, in world units.

    A few floaters do not change it.
    """
    means = model.means.astype(np.float64)
    return float(np.quantile(np.linalg.norm(means - np.median(means, axis=0), axis=1), INNER))


def _vector(setting: str, text: str) -> Float64:
    try:
        vector = np.array([float(number) for number in text.split(",")])
    except ValueError:
        vector = np.zeros(0)
    fits = vector.shape == (3,) and bool(np.isfinite(vector).all())
    require("rigid_transform", setting, text, "three numbers separated by commas", fits=fits)
    return vector


ATTACKS = named(
    {
        crop: Strength("fraction", 1.0, 0.0),
        rigid_transform: None,
        densify_clone: Strength("fraction", 0.0, 1.0),
        inject: Strength("fraction", 0.0, 1.0),
        merge: None,
        reorder: None,
    }
)
