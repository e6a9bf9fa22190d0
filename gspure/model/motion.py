"""Motion of a whole model: rotation about the origin, scaling and translation."""

import numpy as np

from gspure.files import Float64
from gspure.model.gaussians import Gaussians
from gspure.model.sh_rotation import rotate_sh


def moved(model: Gaussians, rotvec: Float64, translation: Float64, scale: float = 1.0) -> Gaussians:
    """Return the model rotated about `rotvec` by its length in radians, then scaled, then translated.

    Centres, scales, rotations and spherical harmonics change, so that the model looks the same from views that move
    along. Features without direction, as GS-Hider's, stay.
    """
    angle = float(np.linalg.norm(rotvec))
    if angle:
        product = _left_product(np.cos(angle / 2), *np.sin(angle / 2) * rotvec / angle)
        model = model.with_columns({f"rot_{i}": column for i, column in enumerate(product @ model.quats.T)})
        if model.sh_degree > 0:
            model = model.with_appearance(model.table["opacity"], rotate_sh(model.sh_coeffs, rotvec))
    if scale != 1:
        names = model.columns_named("scale_")
        model = model.with_columns({name: model.table[name] + np.log(scale) for name in names})
    means = (scale * (model.means @ rotation(rotvec).T) + translation).astype(np.float32)
    return model.with_columns(dict(zip("xyz", means.T, strict=True)))


def rotation(rotvec: Float64) -> Float64:
    """Return the rotation [3,3] about `rotvec` by its length in radians (Rodrigues)."""
    angle = float(np.linalg.norm(rotvec))
    x, y, z = rotvec / (angle or 1.0)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix: Float64 = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return matrix


def _left_product(w: float, x: float, y: float, z: float) -> Float64:
    """Return the matrix [4,4] of left multiplication by the quaternion (w, x, y, z)."""
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
