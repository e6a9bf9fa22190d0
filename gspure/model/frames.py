r"""Frames of Gaussians: 24 turns of the axes, with other scales, describe the same ellipsoid.

If R and S are rotation and scales, and a turn g of the cube maps axes to axes, then :math:`R g` with permuted scales,
:math:`g^T S g`, has the same covariance :math:`R S^2 R^T`. So has a quaternion of any norm and of either sign.
"""

from collections.abc import Callable
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Float64, Indices
from gspure.model.gaussians import ROTATION, SCALES, Gaussians
from gspure.model.rotations import rotation_matrices

Cost = Callable[[Float64, Float32], Float64]
"""From unit quaternions [K,4] and log-scales [K,3] to a number [K]."""


def _turns() -> Float64:
    """Return the turns of a cube [24,4]: quaternions of one, two or four equal parts, the first of them positive.

    The first keeps the order of the axes.
    """
    parts = np.array(list(product((0.0, 1.0, -1.0), repeat=4)))
    counts = np.count_nonzero(parts, axis=1)
    first = np.take_along_axis(parts, (parts != 0).argmax(axis=1)[:, None], axis=1)[:, 0]
    return parts[np.isin(counts, (1, 2, 4)) & (first > 0)]


def _products(turns: Float64) -> Float64:
    """Return the matrices [24,4,4] that multiply a quaternion by each of the turns from the right."""
    w, x, y, z = turns.T
    rows = [[w, -x, -y, -z], [x, w, z, -y], [y, -z, w, x], [z, y, -x, w]]
    return np.array(rows).transpose(2, 0, 1)


TURNS: Final = _turns()
ORDERS: Final = np.abs(rotation_matrices(TURNS)).argmax(axis=1)  # [24,3]: which old axis each new axis is
_PRODUCTS: Final = _products(TURNS)


def turned(quats: NDArray[Any], log_scales: Float32, turns: Indices) -> tuple[Float64, Float32]:
    """Return quaternions [K,4], of another norm, and log-scales [K,3] after a turn of the axes of each Gaussian [K]."""
    turned_quats = np.einsum("kij,kj->ki", _PRODUCTS[turns], np.asarray(quats, np.float64))
    return turned_quats, np.take_along_axis(log_scales, ORDERS[turns], axis=1)


def frame_columns(quats: NDArray[Any], log_scales: Float32) -> dict[str, NDArray[Any]]:
    """Return the columns of quaternions [K,4] and log-scales [K,3]."""
    rotations = dict(zip(ROTATION, quats.T, strict=True))
    return rotations | dict(zip(SCALES, log_scales.T, strict=True))


def canonical(quats: NDArray[Any], log_scales: Float32) -> tuple[Float32, Float32]:
    """Return the quaternions [K,4] and log-scales [K,3] of the canonical frames.

    Scales ascend; of the turns that keep them so, that with the largest w; the quaternion has norm 1 and w above 0.
    """

    def cost(unit: Float64, scales: Float32) -> Float64:
        ascending = (np.diff(scales, axis=1) >= 0).all(axis=1)
        return np.where(ascending, -np.abs(unit[:, 0]), np.inf)

    unit, scales = _best(quats, log_scales, cost)
    unit *= np.where(unit[:, :1] < 0, -1, 1)
    return unit.astype(np.float32), scales


def nearest(quats: NDArray[Any], log_scales: Float32, wanted: Gaussians) -> dict[str, NDArray[Any]]:
    """Return the columns of scales and rotations in the frames nearest to those of `wanted` [K], with their norms."""
    norms = np.linalg.norm(wanted.quats.astype(np.float64), axis=1, keepdims=True)
    directions = _unit(wanted.quats)

    def cost(unit: Float64, scales: Float32) -> Float64:
        closeness = np.abs((unit * directions).sum(axis=1))
        distances: Float64 = np.square(scales - wanted.log_scales).sum(axis=1) - 2 * closeness
        return distances

    unit, scales = _best(quats, log_scales, cost)
    backwards = (unit * directions).sum(axis=1, keepdims=True) < 0
    rotations = (norms * np.where(backwards, -unit, unit)).astype(np.float32)
    return frame_columns(rotations, scales)


def _best(quats: NDArray[Any], log_scales: Float32, cost: Cost) -> tuple[Float64, Float32]:
    """Return unit quaternions and log-scales in the frames of least cost."""
    unit = _unit(quats)
    best = np.zeros(len(unit), np.intp)
    least = np.full(len(unit), np.inf)
    for turn, (matrix, order) in enumerate(zip(_PRODUCTS, ORDERS, strict=True)):
        candidate = unit @ (matrix.T / np.linalg.norm(TURNS[turn]))
        costs = cost(candidate, log_scales[:, order])
        lower = costs < least
        least[lower] = costs[lower]
        best[lower] = turn
    turned_quats, scales = turned(unit, log_scales, best)
    return _unit(turned_quats), scales


def _unit(quats: NDArray[Any]) -> Float64:
    """Return quaternions [K,4] of norm 1; zero stays zero."""
    norms = np.linalg.norm(np.asarray(quats, np.float64), axis=1, keepdims=True)
    return np.asarray(quats / np.where(norms > 0, norms, 1))
