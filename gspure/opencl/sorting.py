"""Sorts: stable counting sorts of the cpu style (counting.cl), and a radix sort for many small cores (sorting.cl)."""

import numpy as np
import pyopencl as cl

from gspure.opencl.buffers import Scratch
from gspure.opencl.engine import Engine

CHUNK_GROUP = 1  # work-group of the kernels with a work-item per chunk; in larger ones, work-items wait for each other
_LEAST_ITEMS = 1024  # of a chunk; fewer are not worth a separate histogram
_SCAN_BINS = 64

GROUP = 256
TILE = 2048  # pairs that a work-group sorts


def chunk_count(engine: Engine, items: int) -> int:
    """Return the number of chunks in which to sort `items`; the sorted order does not depend on it."""
    units: int = engine.device.max_compute_units
    return max(min(8 * units, 128, items // _LEAST_ITEMS), 1)


def first_places(engine: Engine, histogram: cl.Buffer, chunks: int, bins: int, starts: cl.Buffer) -> None:
    """Turn `histogram` [chunks,bins] into offsets within each bin, and write the bins' prefix sums into `starts`."""
    program = engine.program("counting", SCAN_ITEMS=1, SCAN_BINS=_SCAN_BINS)
    totals = engine.buffers.totals.sized(bins)
    program.launch("scan_chunks", -(-bins // _SCAN_BINS), chunks, bins, histogram, totals, group=CHUNK_GROUP)
    program.launch("scan_totals", 1, bins, totals, starts, group=CHUNK_GROUP)


def prefix_sums(engine: Engine, counts: cl.Buffer, length: int, starts: Scratch) -> tuple[cl.Buffer, int]:
    """Write the length + 1 exclusive prefix sums of `counts` into `starts`; return (its buffer, total).

    The sums have 32 bits. The total is exact; if it does not fit, the sums are useless.
    """
    sums = np.zeros(length + 1, np.uint64)
    with engine.mapped(counts, (length,), np.uint32) as values:
        np.cumsum(values, out=sums[1:])
    return starts.holding(sums.astype(np.uint32)), int(sums[-1])


def sort_pairs(
    engine: Engine, pairs: tuple[cl.Buffer, cl.Buffer], length: cl.Buffer, capacity: int, bits: int
) -> cl.Buffer:
    """Sort pairs (key << 32 | value) by the lower `bits` of their keys; equal keys keep their order.

    `pairs` are two buffers, the first with the pairs; return the one with the sorted pairs. `length` [1] is the number
    of pairs, at most `capacity`.
    """
    program = engine.program("sorting", SORT_GROUP=GROUP, SORT_TILE=TILE)
    tiles = -(-capacity // TILE)
    counts = engine.buffers.histogram.sized(256, tiles)
    totals = engine.buffers.totals.sized(256)
    source, target = pairs
    for shift in range(0, bits if capacity else 0, 8):
        program.launch("count_digits", tiles * GROUP, tiles, shift, length, source, counts, group=GROUP)
        program.launch("scan_digits", 256 * GROUP, tiles, counts, totals, group=GROUP)
        arguments = (tiles, shift, length, source, counts, totals, target)
        program.launch("scatter_pairs", tiles * GROUP, *arguments, group=GROUP)
        source, target = target, source
    return source


def running_sums(engine: Engine, values: cl.Buffer, count: int) -> None:
    """Replace each of `count` values by the sum of the values before it; append the sum of all."""
    program = engine.program("sorting", SORT_GROUP=GROUP, SORT_TILE=TILE)
    tiles = max(-(-count // TILE), 1)
    sums = engine.buffers.histogram.sized(tiles)
    starts = engine.buffers.digit_starts.sized(tiles + 1)
    program.launch("sum_tiles", tiles * GROUP, count, values, sums, group=GROUP)
    counting = engine.program("counting", SCAN_ITEMS=GROUP, SCAN_BINS=GROUP)
    counting.launch("scan_totals", GROUP, tiles, sums, starts, group=GROUP)
    program.launch("add_tile_sums", count + 1, count, tiles, starts, values, group=GROUP)
