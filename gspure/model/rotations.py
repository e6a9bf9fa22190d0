r"""Rotations: matrices and principal axes of Gaussians, similarity transforms of models, and spherical harmonics.

A function on the sphere, :math:`f(d) = \sum_m c_m Y_m(d)`, rotated by R is :math:`f(R^{-1} d)`. Its coefficients of
degree l are those of f times an orthogonal matrix. For a rotation by :math:`\theta` about the axis n this matrix is

.. math:: D_l = U\, e^{-i \theta\, n \cdot J_l}\, U^\dagger

with the matrices :math:`J_l` of angular momentum for the complex harmonics (Sakurai, *Modern Quantum Mechanics*, §3.5)
and U, which maps them to the real harmonics of 3DGS: :math:`\sqrt 2\, \mathrm{Re}\, Y_l^m` for m > 0, :math:`\sqrt 2\,
\mathrm{Im}\, Y_l^{|m|}` for m < 0, with the Condon-Shortley sign.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64
from gspure.model.gaussians import Gaussians


def rotation_matrices(quats: NDArray[Any]) -> Float64:
    """Return the rotation matrices [K,3,3] of quaternions (w, x, y, z) [K,4] of any norm but zero."""
    quats = np.asarray(quats, np.float64)
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def principal_axes(model: Gaussians) -> Float64:
    """Return each Gaussian's axes, one standard deviation long: [K,3 axes,3]; NaN for a zero quaternion."""
    quats = model.quats.astype(np.float64)
    with np.errstate(invalid="ignore"):
        w, xyz = np.split(quats / np.linalg.norm(quats, axis=1, keepdims=True), [1], axis=1)
        axes = model.scales[:, :, None] * np.eye(3)
        # A unit quaternion (w, u) turns v into v + w t + u x t, where t = 2 u x v.
        t = 2 * np.cross(xyz[:, None], axes)
        return np.asarray(axes + w[:, None] * t + np.cross(xyz[:, None], t))


def moved(model: Gaussians, rotvec: Float64, translation: Float64, scale: float = 1.0) -> Gaussians:
    """Return the model rotated about `rotvec` by its length in radians, then scaled, then translated.

    Centres, scales, rotations and spherical harmonics change, so that the model looks the same from views moved in the
    same way. Features without direction, such as GS-Hider's, stay.
    """
    angle = float(np.linalg.norm(rotvec))
    if angle:
        w = np.cos(angle / 2)
        x, y, z = np.sin(angle / 2) * rotvec / angle
        product = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
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


def rotate_sh(sh_coeffs: NDArray[Any], rotvec: Float64) -> NDArray[Any]:
    """Return coefficients [K,S,3], S = 1, 4, 9 or 16, of colours rotated about `rotvec` by its length in radians."""
    rotated = sh_coeffs.copy()
    for degree in range(1, int(np.sqrt(sh_coeffs.shape[1]))):
        phases, states = np.linalg.eigh(np.tensordot(rotvec, _angular_momentum(degree), 1))
        exponential = (states * np.exp(-1j * phases)) @ states.conj().T
        to_real = _to_real(degree)
        matrix = np.ascontiguousarray((to_real @ exponential @ to_real.conj().T).real)  # D_l, for m = -l .. l
        band = slice(degree**2, (degree + 1) ** 2)
        rotated[:, band] = np.einsum("ij,kjc->kic", matrix, rotated[:, band])
    return rotated


def _angular_momentum(degree: int) -> NDArray[np.complex128]:
    """Return J_x, J_y, J_z [3,2l+1,2l+1] of the complex harmonics."""
    orders = np.arange(-degree, degree)
    raising = np.diag(np.sqrt(degree * (degree + 1) - orders * (orders + 1.0)), -1).astype(np.complex128)
    lowering = raising.T
    along = np.diag(np.arange(-degree, degree + 1)).astype(np.complex128)
    return np.stack([(raising + lowering) / 2, (raising - lowering) / 2j, along])


def _to_real(degree: int) -> NDArray[np.complex128]:
    """Return U [2l+1,2l+1], which maps coefficients of the complex harmonics to those of the real ones."""
    to_real = np.zeros((2 * degree + 1, 2 * degree + 1), np.complex128)
    to_real[degree, degree] = 1
    for m in range(1, degree + 1):
        sign = (-1) ** m  # Y^{-m} = (-1)^m conj(Y^m)
        pair = [degree + m, degree - m]
        to_real[degree + m, pair] = np.array([1, sign]) / np.sqrt(2)
        to_real[degree - m, pair] = np.array([1j, -1j * sign]) / np.sqrt(2)
    return to_real
