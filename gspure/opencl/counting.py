"""The common part of the stable counting sorts (counting.cl)."""

import numpy as np
import pyopencl as cl

from gspure.constants import SCAN_BINS
from gspure.opencl.buffers import Scratch
from gspure.opencl.engine import Engine

_LEAST_ITEMS = {"cpu": 1024, "gpu": 64}  # fewer are not worth a histogram of their own


def chunks(engine: Engine, items: int) -> int:
    """Return into how many chunks to cut `items`; the result of a sort does not depend on it."""
    most = min(8 * engine.device.max_compute_units, 128) if engine.style == "cpu" else 1024
    return max(min(most, items // _LEAST_ITEMS[engine.style]), 1)


def first_places(engine: Engine, histogram: cl.Buffer, parts: int, bins: int, starts: cl.Buffer) -> None:
    """Turn `histogram` [parts,bins] into offsets within each bin, and write the bins' prefix sums into `starts`."""
    program, totals = engine.program("counting"), engine.buffers.totals.sized(bins)
    program.launch("scan_chunks", -(-bins // SCAN_BINS), parts, bins, histogram, totals)
    program.launch("scan_totals", 1, bins, totals, starts)


def prefix_sums(engine: Engine, counts: cl.Buffer, length: int, starts: Scratch) -> tuple[cl.Buffer, int]:
    """Write the length + 1 exclusive prefix sums of `counts` into `starts`; return (its buffer, total).

    The sums have 32 bits. The total is exact; if it does not fit, the sums are useless.
    """
    sums = np.zeros(length + 1, np.uint64)
    with engine.mapped(counts, (length,), np.uint32) as values:
        np.cumsum(values, out=sums[1:])
    return starts.holding(sums.astype(np.uint32)), int(sums[-1])
