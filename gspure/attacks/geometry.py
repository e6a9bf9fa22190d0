"""Attacks on where the model is: cropping and rigid motion."""

from typing import Annotated, Final

import numpy as np

from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked, require, require_attribute
from gspure.attacks.strength import Strength
from gspure.files import Float64
from gspure.model.gaussians import Gaussians
from gspure.model.rotations import moved, rotation
from gspure.progress import warn
from gspure.public_model import Columns
from gspure.settings import Range, Share

CROPPED: Final = 0.5  # side of the box, relative to the model's; ours
FLOATERS: Final = 0.01  # fraction of the centres beyond the model's box, at either end of each axis; ours
INNER: Final = 0.9  # fraction of the rows within the radius; ours
FARTHEST: Final = 1e4  # largest translation in radii: there, float32 rounds centres to a thousandth of the radius; ours

COARSE: Final = 1e-3  # steps of float32 in radii, from which on moved centres are too coarse; ours

ANGLE: Final = 30.0
DEGREES: Final = Range(-3600.0, 3600.0)
AXIS: Final = "0,1,0"
TRANSLATION: Final = "0,0,0"


def crop(model: Gaussians, _rng: Rng, *, fraction: Share = CROPPED) -> Attacked:
    """Keep the rows in a box around the median of the centres, `fraction` (0 to 1) of the model's along each axis."""
    if not len(model):
        return Attacked.without(model, np.zeros(0, np.bool_))
    means = model.means.astype(np.float64)
    low, median, high = np.quantile(means, [FLOATERS, 0.5, 1 - FLOATERS], axis=0)
    inside = (means >= median + fraction * (low - median)) & (means <= median + fraction * (high - median))
    return Attacked.without(model, ~inside.all(axis=1))


def rigid_transform(
    model: Gaussians,
    _rng: Rng,
    columns: Columns,
    *,
    angle: Annotated[float, DEGREES] = ANGLE,
    axis: str = AXIS,
    translation: str = TRANSLATION,
) -> Attacked:
    """Rotate the model about an axis through the world's origin, in degrees, then translate it.

    `axis` are three numbers separated by commas, of any length but zero; so is `translation`, in radii of the model,
    none beyond `FARTHEST`.

    The model looks the same from views that move along (`gspure.model.rotations`). Anchors can only be translated:
    their networks read the viewing direction in world coordinates.
    """
    direction, shift = _vector("axis", axis), _vector("translation", translation)
    length = float(np.linalg.norm(direction))
    require("rigid_transform", "axis", axis, "an axis", fits=length > 0)
    near = bool((np.abs(shift) <= FARTHEST).all())
    require("rigid_transform", "translation", translation, f"at most {FARTHEST:.0f} radii (float32)", fits=near)
    shift *= radius(model)
    rotvec = direction / length * np.deg2rad(angle)
    transform = np.eye(4)
    transform[:3, :3] = rotation(rotvec)
    transform[:3, 3] = shift
    if angle:
        require_attribute("rigid_transform", columns, "rotation")
    warn_of_coarse_centres("rigid_transform", model)
    return Attacked(moved(model, rotvec, shift), np.arange(len(model)), len(model), transform)


def warn_of_coarse_centres(attack: str, model: Gaussians) -> None:
    """Warn of a model so far from the origin that float32 rounds its moved centres by a thousandth of its radius."""
    farthest = np.abs(np.median(model.means, axis=0)).max(initial=0.0) if len(model) else 0.0
    step, size = float(np.spacing(np.float32(farthest))), radius(model)
    if step > COARSE * size > 0:
        far = f"the model is far from the origin (coordinate {farthest:.3g})"
        apart = f"where float32 values are {step:.2g} apart ({step / size:.2g} radii of the model)"
        warn(f"{attack}: {far}, {apart}, so moved centres are rounded; first move model and cameras near the origin")


def radius(model: Gaussians) -> float:
    """Return the distance from the median of the centres that holds `INNER` of them, in world units.

    A few floaters do not change it.
    """
    if not len(model):
        return 0.0
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


ATTACKS = named({crop: Strength("fraction", 1.0, 0.0), rigid_transform: None})
