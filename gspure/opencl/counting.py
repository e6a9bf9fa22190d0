"""The common part of the stable counting sorts of the cpu style (counting.cl)."""

import numpy as np
import pyopencl as cl

from gspure.opencl.buffers import Scratch
from gspure.opencl.engine import Engine

CHUNK_GROUP = 1  # work-group of the kernels with a work-item per chunk; in larger ones, they would wait for each other
_LEAST_ITEMS = 1024  # fewer are not worth a histogram of their own
_SCAN_BINS = 64


def chunks(engine: Engine, items: int) -> int:
    """Return into how many chunks to cut `items`; the result of a sort does not depend on it."""
    units: int = engine.device.max_compute_units
    return max(min(8 * units, 128, items // _LEAST_ITEMS), 1)


def first_places(engine: Engine, histogram: cl.Buffer, parts: int, bins: int, starts: cl.Buffer) -> None:
    """Turn `histogram` [parts,bins] into offsets within each bin, and write the bins' prefix sums into `starts`."""
    program, totals = engine.program("counting", SCAN_ITEMS=1, SCAN_BINS=_SCAN_BINS), engine.buffers.totals.sized(bins)
    program.launch("scan_chunks", -(-bins // _SCAN_BINS), parts, bins, histogram, totals, group=CHUNK_GROUP)
    program.launch("scan_totals", 1, bins, totals, starts, group=CHUNK_GROUP)


def prefix_sums(engine: Engine, counts: cl.Buffer, length: int, starts: Scratch) -> tuple[cl.Buffer, int]:
    """Write the length + 1 exclusive prefix sums of `counts` into `starts`; return (its buffer, total).

    The sums have 32 bits. The total is exact; if it does not fit, the sums are useless.
    """
    sums = np.zeros(length + 1, np.uint64)
    with engine.mapped(counts, (length,), np.uint32) as values:
        np.cumsum(values, out=sums[1:])
    return starts.holding(sums.astype(np.uint32)), int(sums[-1])
