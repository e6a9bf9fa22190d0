"""The depth order of the visible Gaussians (ordering.cl)."""

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from gspure.opencl.engine import Engine
from gspure.opencl.sorting import CHUNK_GROUP, chunk_count, first_places, sort_pairs
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
    if engine.style == "gpu":
        return _sort_pairs_by_depth(engine, storage, depth_keys)
    buffers = engine.buffers
    count = storage.count
    digits = 1 << _RADIX_BITS
    chunks = chunk_count(engine, count)
    starts = buffers.digit_starts.sized(digits + 1)
    histogram = buffers.histogram.sized(chunks, digits)
    scratch = (buffers.even_pairs, buffers.odd_pairs)
    items = depth_keys
    positions = buffers.positions.sized(count)
    for digit in range(_PASSES):
        program = engine.program("layout", "ordering", RADIX_BITS=_RADIX_BITS, FIRST_PASS=int(digit == 0))
        shape = (count, chunks, digit * _RADIX_BITS)
        pairs = scratch[digit % 2].sized(count, 2)
        program.launch("count_digits", chunks, *shape, starts, items, histogram, group=CHUNK_GROUP)
        first_places(engine, histogram, chunks, digits, starts)
        program.launch("scatter_digits", chunks, *shape, starts, items, histogram, pairs, group=CHUNK_GROUP)
        items = pairs
    program.launch("order_ties", chunks, count, chunks, starts, items, storage.rows, positions, group=CHUNK_GROUP)
    return DepthOrder(positions, int(engine.read(starts, (digits + 1,), np.uint32)[-1]))


def _sort_pairs_by_depth(engine: Engine, storage: Storage, depth_keys: cl.Buffer) -> DepthOrder:
    """Sort pairs by a stable sort. They are in row order before it, so equal depths are in row order after it."""
    buffers = engine.buffers
    count = storage.count
    program = engine.program("layout", "pairs")
    pairs = (buffers.even_pairs.sized(count, 2), buffers.odd_pairs.sized(count, 2))
    counts = buffers.digit_starts.sized(2)  # [all, visible]
    positions = buffers.positions.sized(count)
    program.launch("pair_keys", count, count, storage.places, depth_keys, pairs[0], counts)
    ordered = sort_pairs(engine, pairs, counts, count, bits=32)
    program.launch("take_positions", count, count, ordered, positions, counts)
    visible = int(engine.read(counts, (2,), np.uint32)[1]) if count else 0
    return DepthOrder(positions, visible)
