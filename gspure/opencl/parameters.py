"""A model's arrays on the device, in blocks of 16 rows: [rows / 16][attributes][16] (see vector.cl)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.model.gaussians import Gaussians, sigmoid
from gspure.opencl.engine import Engine

BLOCK = 16
GEOMETRY_ATTRIBUTES = 11
_CHUNK_ROWS = 1 << 16  # rows converted at a time, so that no second copy of the model is ever held


def upload_geometry(engine: Engine, model: Gaussians) -> cl.Buffer:
    """Upload means, quaternions, scales and opacity: 11 attributes; rows that pad the last block are transparent."""

    def rows(part: Gaussians) -> NDArray[np.float32]:
        stored = part.columns(
            "x", "y", "z", *(f"rot_{i}" for i in range(4)), *(f"scale_{i}" for i in range(3)), "opacity"
        )
        with np.errstate(over="ignore"):
            stored[:, 7:10] = np.exp(stored[:, 7:10])
        stored[:, 10] = sigmoid(stored[:, 10])
        return stored

    return _upload_model(engine, model, GEOMETRY_ATTRIBUTES, rows)


def upload_sh_coeffs(engine: Engine, model: Gaussians) -> cl.Buffer:
    """Upload the spherical-harmonic coefficients: attribute 3 b + c holds band b of colour channel c."""
    attributes = 3 * (model.sh_degree + 1) ** 2
    return _upload_model(engine, model, attributes, lambda part: part.sh_coeffs.reshape(len(part), attributes))


def upload_features(engine: Engine, features: NDArray[np.float32]) -> cl.Buffer:
    """Upload any-channel features [K,C]."""
    count, attributes = features.shape
    return _upload(engine, count, attributes, lambda begin, end: features[begin:end])


def _upload_model(
    engine: Engine, model: Gaussians, attributes: int, rows: Callable[[Gaussians], NDArray[np.float32]]
) -> cl.Buffer:
    return _upload(engine, len(model), attributes, lambda begin, end: rows(Gaussians(model.table[begin:end])))


def _upload(engine: Engine, count: int, attributes: int, rows: Callable[[int, int], NDArray[Any]]) -> cl.Buffer:
    blocks = max(-(-count // BLOCK), 1)
    buffer = engine.allocate(4 * blocks * attributes * BLOCK)
    with engine.mapped(buffer, (blocks, attributes, BLOCK), np.float32, write=True) as blocked:
        blocked[-1] = 0.0
        for begin in range(0, count, _CHUNK_ROWS):
            part = np.asarray(rows(begin, min(begin + _CHUNK_ROWS, count)), np.float32)
            whole = len(part) // BLOCK
            first = begin // BLOCK
            blocked[first : first + whole] = part[: whole * BLOCK].reshape(whole, BLOCK, attributes).transpose(0, 2, 1)
            if len(part) % BLOCK:
                blocked[-1, :, : len(part) % BLOCK] = part[whole * BLOCK :].T
    return buffer
