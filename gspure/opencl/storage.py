"""A model's arrays on the device: along a space-filling curve, in blocks of 16 (see vector.cl)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.model.activations import sigmoid
from gspure.model.gaussians import Gaussians
from gspure.opencl.engine import Engine
from gspure.opencl.morton import morton_order

BLOCK = 16
_CHUNK = 1 << 14  # Gaussians converted at a time, so that no second copy of the model is ever held
_GEOMETRY = ("x", "y", "z", *(f"rot_{i}" for i in range(4)), *(f"scale_{i}" for i in range(3)), "opacity")
GEOMETRY_ATTRIBUTES = len(_GEOMETRY)

Rows = NDArray[np.uint32]


@dataclass(frozen=True)
class Storage:
    """Where each Gaussian lies: `order` [K] holds the row at each position.

    On the device: the same as `rows`, its inverse as `positions`, and the geometry (means, quaternions, scales,
    opacity).
    """

    order: Rows
    rows: cl.Buffer
    positions: cl.Buffer
    geometry: cl.Buffer

    @property
    def count(self) -> int:
        """Number of Gaussians."""
        return len(self.order)

    @staticmethod
    def along(engine: Engine, order: Rows, geometry: cl.Buffer) -> Storage:
        """Take activated geometry [K,11] that was uploaded in `order`."""
        return Storage(order, engine.upload("rows", order), engine.upload("positions", _positions(order)), geometry)


def store(engine: Engine, model: Gaussians) -> Storage:
    """Upload what a model's projection needs."""

    def geometry(rows: slice) -> NDArray[np.float32]:
        stored = Gaussians(model.table[rows]).columns(*_GEOMETRY)
        model.release_pages()
        with np.errstate(over="ignore"):
            stored[:, 7:10] = np.exp(stored[:, 7:10])
        stored[:, 10] = sigmoid(stored[:, 10])
        return stored

    order = morton_order(model.means)
    return Storage.along(engine, order, upload_attributes(engine, order, GEOMETRY_ATTRIBUTES, geometry))


def upload_sh_coeffs(engine: Engine, storage: Storage, model: Gaussians) -> cl.Buffer:
    """Upload the spherical-harmonic coefficients: attribute 3 b + c holds band b of colour channel c."""
    attributes = 3 * (model.sh_degree + 1) ** 2

    def sh_coeffs(rows: slice) -> NDArray[np.float32]:
        stored = Gaussians(model.table[rows]).sh_coeffs
        model.release_pages()
        return stored.reshape(len(stored), attributes)

    return upload_attributes(engine, storage.order, attributes, sh_coeffs)


def upload_features(engine: Engine, storage: Storage, features: NDArray[np.float32]) -> cl.Buffer:
    """Upload any-channel features [K,C]."""
    return upload_attributes(engine, storage.order, features.shape[1], lambda rows: features[rows])


def upload_attributes(
    engine: Engine, order: Rows, attributes: int, values: Callable[[slice], NDArray[np.float32]]
) -> cl.Buffer:
    """Upload ``values(rows)`` [n,attributes] in storage order; what pads the last block is zero, hence transparent."""
    blocks = max(-(-len(order) // BLOCK), 1)
    buffer = engine.allocate(4 * blocks * attributes * BLOCK)
    with engine.mapped(buffer, (blocks, attributes, BLOCK), np.float32, write=True) as blocked:
        blocked[-1] = 0.0
        positions = _positions(order)
        for begin in range(0, len(order), _CHUNK):  # row by row, so that a mapped file is read once through
            rows = slice(begin, begin + _CHUNK)
            block, lane = np.divmod(positions[rows], np.uint32(BLOCK))
            blocked[block, :, lane] = values(rows)
    return buffer


def _positions(order: Rows) -> Rows:
    """Return the position of each row: the inverse of `order`."""
    positions = np.empty_like(order)
    positions[order] = np.arange(len(order), dtype=np.uint32)
    return positions
