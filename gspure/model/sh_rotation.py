r"""Rotation of spherical harmonics.

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

from gspure.files import Float64


def rotate_sh(sh_coeffs: NDArray[Any], rotvec: Float64) -> NDArray[Any]:
    """Return coefficients [K,S,3], S = 1, 4, 9 or 16, of colours rotated about `rotvec` by its length in radians."""
    result = sh_coeffs.copy()
    for degree in range(1, int(np.sqrt(result.shape[1]))):
        band = slice(degree**2, (degree + 1) ** 2)
        result[:, band] = np.einsum("ij,kjc->kic", rotation_matrix(degree, rotvec), result[:, band])
    return result


def rotation_matrix(degree: int, rotvec: Float64) -> Float64:
    """Return D_l [2l+1,2l+1] for the order m = -l .. l."""
    phases, states = np.linalg.eigh(np.tensordot(rotvec, _angular_momentum(degree), 1))
    turn = (states * np.exp(-1j * phases)) @ states.conj().T
    to_real = _to_real(degree)
    return np.ascontiguousarray((to_real @ turn @ to_real.conj().T).real)


def _angular_momentum(degree: int) -> NDArray[np.complex128]:
    """Return J_x, J_y, J_z [3,2l+1,2l+1] of the complex harmonics."""
    orders = np.arange(-degree, degree)
    raising = np.diag(np.sqrt(degree * (degree + 1) - orders * (orders + 1.0)), -1).astype(np.complex128)
    lowering = raising.T
    along = np.diag(np.arange(-degree, degree + 1)).astype(np.complex128)
    return np.stack([(raising + lowering) / 2, (raising - lowering) / 2j, along])


def _to_real(degree: int) -> NDArray[np.complex128]:
    """Return U [2l+1,2l+1]: coefficients of the real harmonics, given those of the complex ones."""
    to_real = np.zeros((2 * degree + 1, 2 * degree + 1), np.complex128)
    to_real[degree, degree] = 1
    for m in range(1, degree + 1):
        sign = (-1) ** m  # Y^{-m} = (-1)^m conj(Y^m)
        pair = [degree + m, degree - m]
        to_real[degree + m, pair] = np.array([1, sign]) / np.sqrt(2)
        to_real[degree - m, pair] = np.array([1j, -1j * sign]) / np.sqrt(2)
    return to_real
