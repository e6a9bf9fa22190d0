"""A model's arrays on the device, in blocks (vector.cl), along a space-filling curve if it has more than `FEW` rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from math import prod

import numpy as np
import pyopencl as cl

from gspure.arrays import Float32, Float64, UInt32
from gspure.constants import BLOCK, GEOMETRY_ATTRIBUTES
from gspure.model.gaussians import Gaussians, sigmoid
from gspure.opencl.buffers import Scratch
from gspure.opencl.engine import Engine

FEW = 1 << 14  # Gaussians; as few fit into caches in any order, so sorting them takes longer than it saves

_CHUNK = 1 << 14  # Gaussians converted at a time, to avoid a second copy of the model
_GEOMETRY = ("x", "y", "z", *(f"rot_{i}" for i in range(4)), *(f"scale_{i}" for i in range(3)), "opacity")
_BITS = 10  # of a cell of the Morton curve, per axis
_SAMPLE = 10_000  # centres, for the extent of the curve

Rows = UInt32


@dataclass(frozen=True)
class Storage:
    """The geometry of a model on the device, and where each Gaussian lies.

    `order` [K] is the row at each position, and `rows` its copy on the device; `places` [K] is the position of each
    row. `geometry` holds activated means, quaternions, scales and opacities, in blocks.
    """

    order: Rows
    rows: cl.Buffer
    geometry: cl.Buffer
    places: cl.Buffer

    @property
    def count(self) -> int:
        """Number of Gaussians."""
        return len(self.order)

    @staticmethod
    def along(engine: Engine, order: Rows, geometry: cl.Buffer) -> Storage:
        """Take activated geometry [K,GEOMETRY_ATTRIBUTES] that was uploaded in `order`."""
        return Storage(order, engine.uploaded(order), geometry, engine.uploaded(positions_of(order)))


def blocked_shape(count: int, attributes: int) -> tuple[int, int, int]:
    """Return the shape [blocks,attributes,BLOCK] of the attributes of `count` Gaussians, at least one block."""
    return max(-(-count // BLOCK), 1), attributes, BLOCK


def store(engine: Engine, model: Gaussians) -> Storage:
    """Upload the geometry of a model, activated."""

    def geometry(rows: slice) -> Float32:
        stored = Gaussians(model.table[rows]).columns(*_GEOMETRY)
        with np.errstate(over="ignore"):
            stored[:, 7:10] = np.exp(stored[:, 7:10])
        stored[:, 10] = sigmoid(stored[:, 10])
        return stored

    order = storage_order(model.means)
    return Storage.along(engine, order, upload_attributes(engine, order, GEOMETRY_ATTRIBUTES, geometry))


def upload_sh_coeffs(engine: Engine, storage: Storage, model: Gaussians) -> cl.Buffer:
    """Upload the spherical-harmonic coefficients: attribute 3 b + c holds band b of colour channel c."""
    attributes = 3 * (model.sh_degree + 1) ** 2

    def sh_coeffs(rows: slice) -> Float32:
        stored = Gaussians(model.table[rows]).sh_coeffs
        return stored.reshape(len(stored), attributes)

    return upload_attributes(engine, storage.order, attributes, sh_coeffs)


def upload_attributes(engine: Engine, order: Rows, attributes: int, values: Callable[[slice], Float32]) -> cl.Buffer:
    """Upload ``values(rows)`` [n,attributes] in storage order; the last block is padded with zeros: transparent."""
    shape = blocked_shape(len(order), attributes)
    buffer = engine.allocate(4 * prod(shape))
    with engine.mapped(buffer, shape, np.float32, write=True) as blocked:
        blocked[-1] = 0.0
        positions = positions_of(order)
        for begin in range(0, len(order), _CHUNK):  # a part at a time: the activated values take memory, too
            rows = slice(begin, begin + _CHUNK)
            block, lane = np.divmod(positions[rows], np.uint32(BLOCK))
            blocked[block, :, lane] = values(rows)
    return buffer


def upload_tables(engine: Engine, tables: Sequence[Float32], blocks: Scratch) -> cl.Buffer:
    """Upload tables [K,n], side by side and in their order of rows, into a buffer that the next upload reuses.

    The last block is padded as by `upload_attributes`.
    """
    count = len(tables[0])
    attributes = sum(table.shape[1] for table in tables)
    shape = blocked_shape(count, attributes)
    buffer = blocks.sized(*shape)
    first = 0
    with ExitStack() as stack:
        for table in tables:
            width = table.shape[1]
            values = stack.enter_context(engine.reading(table))
            engine.program("rows").launch("into_blocks", shape[0], count, width, first, attributes, values, buffer)
            first += width
    return buffer


def positions_of(order: Rows) -> Rows:
    """Return the position of each row: the inverse of `order`."""
    positions = np.empty_like(order)
    positions[order] = np.arange(len(order), dtype=np.uint32)
    return positions


def storage_order(means: Float32) -> Rows:
    """Return the row at each position; results do not depend on it. Up to `FEW` rows keep their order."""
    return morton_order(means) if len(means) > FEW else np.arange(len(means), dtype=np.uint32)


def morton_order(means: Float32) -> UInt32:
    """Return the rows of `means` [K,3] along a Morton (Z-order) curve; rows in one cell keep their order.

    Neighbours on the screen then share cache lines and pages, and whole blocks of 16 fall outside a view together
    (measured by ``benchmarks/``). The cells span the 1 % to 99 % quantiles of each axis, so distant floaters do not
    coarsen them.
    """
    if not len(means):
        return np.zeros(0, np.uint32)
    finite = np.nan_to_num(means, posinf=0.0, neginf=0.0)
    low, high = np.quantile(finite[:: max(1, len(means) // _SAMPLE)], [0.01, 0.99], axis=0)
    return np.argsort(morton_codes(finite, low, high), kind="stable").astype(np.uint32)


def morton_codes(means: Float32 | Float64, low: Float64, high: Float64) -> UInt32:
    """Return the places of finite `means` [K,3] on a Morton curve through the box from `low` to `high` [3]."""
    shares = (means - low) / np.maximum(high - low, np.finfo(np.float32).tiny)
    cells = np.clip(shares * (1 << _BITS), 0, (1 << _BITS) - 1).astype(np.uint32)
    return np.asarray(sum(_spread(cells[:, axis]) << np.uint32(axis) for axis in range(3)), np.uint32)


def _spread(cells: UInt32) -> UInt32:
    """Put two zero bits between neighbouring bits of 10-bit numbers."""
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        cells = (cells | cells << np.uint32(shift)) & np.uint32(mask)
    return cells
