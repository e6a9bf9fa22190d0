"""A radix sort and running sums for devices with many small cores (sorting.cl)."""

import pyopencl as cl

from gspure.opencl.engine import Engine

GROUP = 256
TILE = 2048  # pairs that a work-group sorts


def sort_pairs(
    engine: Engine, pairs: tuple[cl.Buffer, cl.Buffer], length: cl.Buffer, most: int, bits: int
) -> cl.Buffer:
    """Sort pairs (key << 32 | value) by the lower `bits` of their keys; equal keys keep their order.

    `pairs` are a buffer that holds them and a spare one; return the one that holds the sorted pairs. `length` [1] is
    the number of pairs, at most `most`.
    """
    program, tiles = engine.program("sorting", SORT_GROUP=GROUP, SORT_TILE=TILE), -(-most // TILE)
    counts, totals = engine.buffers.histogram.sized(256, tiles), engine.buffers.totals.sized(256)
    unsorted, other = pairs
    for shift in range(0, bits if most else 0, 8):
        program.launch("count_digits", tiles * GROUP, tiles, shift, length, unsorted, counts, group=GROUP)
        program.launch("scan_digits", 256 * GROUP, tiles, counts, totals, group=GROUP)
        arguments = (tiles, shift, length, unsorted, counts, totals, other)
        program.launch("scatter_pairs", tiles * GROUP, *arguments, group=GROUP)
        unsorted, other = other, unsorted
    return unsorted


def running_sums(engine: Engine, values: cl.Buffer, count: int) -> None:
    """Replace each of `count` values by the sum of those before it; write the sum of all behind them."""
    program, tiles = engine.program("sorting", SORT_GROUP=GROUP, SORT_TILE=TILE), max(-(-count // TILE), 1)
    sums, starts = engine.buffers.histogram.sized(tiles), engine.buffers.digit_starts.sized(tiles + 1)
    program.launch("sum_tiles", tiles * GROUP, count, values, sums, group=GROUP)
    counting = engine.program("counting", SCAN_ITEMS=GROUP, SCAN_BINS=GROUP)
    counting.launch("scan_totals", GROUP, tiles, sums, starts, group=GROUP)
    program.launch("add_tile_sums", count + 1, count, tiles, starts, values, group=GROUP)
