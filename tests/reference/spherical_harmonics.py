"""View-dependent colour: real spherical harmonics of degree 0 to 3 in the sign convention of 3DGS models."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64


def sh_basis(directions: NDArray[Any]) -> Float64:
    """Return the 16 real spherical harmonics [K,16] at unit `directions` [K,3], ordered by (degree l, order m).

    Orthonormal over the sphere. Cartesian forms with the Condon-Shortley sign (-1)^m kept, so that odd orders are
    negative: this is what the coefficients of 3DGS files multiply (Fridovich-Keil et al. 2022, Plenoxels, appendix;
    Sloan 2008, "Stupid spherical harmonics tricks", A2).
    """
    x, y, z = directions.T
    pi = np.pi
    return np.stack(
        [
            np.sqrt(1 / (4 * pi)) * np.ones_like(x),
            -np.sqrt(3 / (4 * pi)) * y,
            np.sqrt(3 / (4 * pi)) * z,
            -np.sqrt(3 / (4 * pi)) * x,
            np.sqrt(15 / (4 * pi)) * x * y,
            -np.sqrt(15 / (4 * pi)) * y * z,
            np.sqrt(5 / (16 * pi)) * (2 * z**2 - x**2 - y**2),
            -np.sqrt(15 / (4 * pi)) * x * z,
            np.sqrt(15 / (16 * pi)) * (x**2 - y**2),
            -np.sqrt(35 / (32 * pi)) * y * (3 * x**2 - y**2),
            np.sqrt(105 / (4 * pi)) * x * y * z,
            -np.sqrt(21 / (32 * pi)) * y * (4 * z**2 - x**2 - y**2),
            np.sqrt(7 / (16 * pi)) * z * (2 * z**2 - 3 * x**2 - 3 * y**2),
            -np.sqrt(21 / (32 * pi)) * x * (4 * z**2 - x**2 - y**2),
            np.sqrt(105 / (16 * pi)) * z * (x**2 - y**2),
            -np.sqrt(35 / (32 * pi)) * x * (x**2 - 3 * y**2),
        ],
        axis=1,
    )


def sh_colors(sh_coeffs: NDArray[Any], means: NDArray[Any], centre: NDArray[Any]) -> Float64:
    """Return the colours [K,3] of Gaussians at `means` [K,3] seen from the camera centre [3]: max(0, 0.5 + SH).

    `sh_coeffs` [K,S,3] with S = 1, 4, 9 or 16.
    """
    basis = sh_basis(view_directions(means, centre))[:, : sh_coeffs.shape[1]]
    colors: Float64 = 0.5 + np.einsum("ks,ksc->kc", basis, np.asarray(sh_coeffs, np.float64))
    return np.maximum(colors, 0.0)


def view_directions(means: NDArray[Any], centre: NDArray[Any]) -> Float64:
    """Return the unit vectors [K,3] from the camera to the Gaussians; `means` may be complex."""
    towards = means - np.asarray(centre, np.float64)
    distances = np.sqrt((towards * towards).sum(axis=1, keepdims=True))
    return np.asarray(towards / np.maximum(distances, np.finfo(float).tiny))  # one at the camera itself is never drawn
