"""The depth order of the visible Gaussians (ordering.cl)."""

from __future__ import annotations

from dataclasses import dataclass

import pyopencl as cl

from gspure.opencl.counting import chunks, first_places
from gspure.opencl.engine import Engine
from gspure.opencl.storage import Storage

_RADIX_BITS = 11
_PASSES = 3  # 33 bits for 32-bit keys


@dataclass(frozen=True)
class DepthOrder:
    """The positions of the `visible` Gaussians from front to back; equal depths in row order."""

    positions: cl.Buffer
    visible: int


def sort_by_depth(engine: Engine, storage: Storage, depth_keys: cl.Buffer) -> DepthOrder:
    """Sort the visible Gaussians by (depth, row)."""
    buffers = engine.buffers
    visible = count = storage.count
    parts = chunks(engine, count)
    histogram = buffers.histogram.sized(parts, 1 << _RADIX_BITS)
    row_keys = buffers.row_keys.sized(count)
    sorted_buffers = ((buffers.even_keys, buffers.even_positions), (buffers.odd_keys, buffers.odd_positions))
    keys, positions = depth_keys, storage.positions
    for digit in range(_PASSES):
        program = engine.program("layout", "ordering", RADIX_BITS=_RADIX_BITS, FIRST_PASS=int(digit == 0))
        shape = (visible, parts, digit * _RADIX_BITS)
        sorted_keys, sorted_positions = (scratch.sized(count) for scratch in sorted_buffers[digit % 2])
        program.launch("count_digits", parts, *shape, keys, positions, row_keys, histogram)
        keys = keys if digit else row_keys
        starts, visible = first_places(engine, histogram, parts, 1 << _RADIX_BITS, buffers.digit_starts)
        program.launch(
            "scatter_digits", parts, *shape, keys, positions, histogram, starts, sorted_keys, sorted_positions
        )
        keys, positions = sorted_keys, sorted_positions
    return DepthOrder(positions, visible)
