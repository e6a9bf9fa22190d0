"""The common part of the stable counting sorts (counting.cl)."""

import numpy as np
import pyopencl as cl

from gspure.opencl.buffers import Scratch
from gspure.opencl.engine import Engine

CHUNK_GROUP = 1  # work-group of the kernels with a work-item per chunk; in larger ones, they would wait for each other
_LEAST_ITEMS = {"cpu": 1024, "gpu": 64}  # fewer are not worth a histogram of their own
_SCAN_ITEMS = {"cpu": 1, "gpu": 256}
_SCAN_BINS = {"cpu": 64, "gpu": 16}


def chunks(engine: Engine, items: int) -> int:
    """Return into how many chunks to cut `items`; the result of a sort does not depend on it."""
    most = min(8 * engine.device.max_compute_units, 128) if engine.style == "cpu" else 1024
    return max(min(most, items // _LEAST_ITEMS[engine.style]), 1)


def first_places(engine: Engine, histogram: cl.Buffer, parts: int, bins: int, starts: cl.Buffer) -> None:
    """Turn `histogram` [parts,bins] into offsets within each bin, and write the bins' prefix sums into `starts`."""
    items, per_group = _SCAN_ITEMS[engine.style], _SCAN_BINS[engine.style]
    program = engine.program("counting", SCAN_ITEMS=items, SCAN_BINS=per_group)
    totals, groups = engine.buffers.totals.sized(bins), -(-bins // per_group)
    program.launch("scan_chunks", groups * items, parts, bins, histogram, totals, group=items)
    program.launch("scan_totals", items, bins, totals, starts, group=items)


def prefix_sums(engine: Engine, counts: cl.Buffer, length: int, starts: Scratch) -> tuple[cl.Buffer, int]:
    """Write the length + 1 exclusive prefix sums of `counts` into `starts`; return (its buffer, total).

    The sums have 32 bits. The total is exact; if it does not fit, the sums are useless.
    """
    sums = np.zeros(length + 1, np.uint64)
    with engine.mapped(counts, (length,), np.uint32) as values:
        np.cumsum(values, out=sums[1:])
    return starts.holding(sums.astype(np.uint32)), int(sums[-1])
