"""The depth order of what a view shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from gspure.opencl.counting import chunks, first_places
from gspure.opencl.engine import Engine
from gspure.opencl.projection import Projected
from gspure.opencl.storage import Storage

_RADIX_BITS = 11
_PASSES = 3  # 33 bits for 32-bit keys


@dataclass(frozen=True)
class DepthOrder:
    """The positions of the `visible` Gaussians from front to back; equal depths in row order."""

    positions: cl.Buffer
    visible: int


def sort_by_depth(engine: Engine, projected: Projected, storage: Storage) -> DepthOrder:
    """Sort the visible Gaussians by (depth, row) (ordering.cl)."""
    visible = projected.count
    parts = chunks(engine, visible)
    histogram = engine.buffer("histogram", 4 * parts << _RADIX_BITS)
    keys, positions = projected.depth_keys, storage.positions
    row_keys = engine.buffer("row_keys", 4 * projected.count)
    for digit in range(_PASSES):
        shape = (np.uint32(visible), np.uint32(parts), np.uint32(digit * _RADIX_BITS))
        sorted_keys = engine.buffer(f"sorted_keys_{digit % 2}", 4 * projected.count)
        sorted_positions = engine.buffer(f"sorted_positions_{digit % 2}", 4 * projected.count)
        count_digits, scatter_digits = (
            engine.kernel(
                name, "layout", "ordering", RADIX_BITS=_RADIX_BITS, FIRST_PASS=int(digit == 0), RAY=0, CHANNELS=0
            )
            for name in ("count_digits", "scatter_digits")
        )
        engine.run(count_digits, parts, *shape, keys, positions, row_keys, histogram)
        keys = keys if digit else row_keys
        digit_starts, visible = first_places(engine, "digit_starts", histogram, parts, 1 << _RADIX_BITS)
        engine.run(
            scatter_digits,
            parts,
            *(*shape, keys, positions, histogram, digit_starts, sorted_keys, sorted_positions),
        )
        keys, positions = sorted_keys, sorted_positions
    return DepthOrder(positions, visible)
