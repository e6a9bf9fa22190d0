"""Rigid motion of the whole model, with the views that it is looked at from."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.attributes import require_gaussians
from gspure.attacks.extent import radius
from gspure.attacks.harmonics import turned
from gspure.attacks.settings import require
from gspure.model.gaussians import Gaussians

Float64 = NDArray[np.float64]

ANGLE: Final = 30.0
AXIS: Final = "0,1,0"
TRANSLATION: Final = "0,0,0"


def rigid_transform(
    model: Gaussians, _rng: Rng, *, angle: float = ANGLE, axis: str = AXIS, translation: str = TRANSLATION
) -> Attacked:
    """Turn the model about an axis through the origin of its world, then shift it.

    Centres, rotations and spherical harmonics are turned, so that the model looks the same from views that are moved
    along. Features without direction, as GS-Hider's, stay as they are. Anchors can be shifted only: their networks read
    the direction from which they are seen.

    Parameters
    ----------
    model : Gaussians
    angle : float
        Degrees.
    axis : str
        Three numbers by commas, of any length but zero.
    translation : str
        Three numbers by commas, in multiples of the model's radius.

    """
    require("rigid_transform", "angle", angle, "a number", fits=bool(np.isfinite(angle)))
    direction, shift = _vector("axis", axis), _vector("translation", translation) * radius(model)
    length = float(np.linalg.norm(direction))
    require("rigid_transform", "axis", axis, "an axis", fits=length > 0)
    radians = float(np.deg2rad(angle))
    world = np.eye(4)
    world[:3, :3] = _matrix(direction / length, radians)
    world[:3, 3] = shift
    if angle:
        require_gaussians("rigid_transform", model, "a rotation")
        model = _turned(model, direction / length, radians)
    means = (model.means @ world[:3, :3].T + shift).astype(np.float32)
    return Attacked.changed(model, dict(zip("xyz", means.T, strict=True)), world)


def _turned(model: Gaussians, axis: Float64, radians: float) -> Gaussians:
    """Return the model with every Gaussian turned where it stands."""
    turn = _left_product(np.cos(radians / 2), *np.sin(radians / 2) * axis)
    result = model.with_columns({f"rot_{i}": column for i, column in enumerate(turn @ model.quats.T)})
    if model.sh_degree <= 0:
        return result
    return result.with_appearance(model.table["opacity"], turned(model.sh_coeffs, axis, radians))


def _vector(setting: str, text: str) -> Float64:
    try:
        vector = np.array([float(number) for number in text.split(",")])
    except ValueError:
        vector = np.zeros(0)
    fits = vector.shape == (3,) and bool(np.isfinite(vector).all())
    require("rigid_transform", setting, text, "three numbers by commas", fits=fits)
    return vector


def _matrix(axis: Float64, radians: float) -> Float64:
    """Return the rotation [3,3] about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: Float64 = np.eye(3) + np.sin(radians) * cross + (1 - np.cos(radians)) * cross @ cross
    return rotation


def _left_product(w: float, x: float, y: float, z: float) -> Float64:
    """Return the matrix [4,4] by which the quaternion (w, x, y, z) multiplies others from the left."""
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])


ATTACK = Attack("rigid_transform", rigid_transform)
