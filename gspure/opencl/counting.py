"""What the stable counting sorts share: chunk scans on the device, prefix sums over the bins on the host."""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from gspure.opencl.engine import Engine

_SCAN_BINS = 64  # counting.cl
_CHUNKS = {"cpu": 128, "gpu": 1024}
_LEAST_ITEMS = 64  # fewer are not worth a histogram of their own


def chunks(engine: Engine, items: int) -> int:
    """Return into how many parts to cut `items`; the result of a sort does not depend on it."""
    return max(min(_CHUNKS[engine.style], items // _LEAST_ITEMS), 1)


def first_places(engine: Engine, name: str, histogram: cl.Buffer, parts: int, bins: int) -> tuple[cl.Buffer, int]:
    """Turn `histogram` [parts][bins] into offsets within each bin; return (prefix sums over the bins, total)."""
    totals = engine.buffer("totals", 4 * bins)
    kernel = engine.kernel("scan_chunks", "counting")
    engine.run(kernel, -(-bins // _SCAN_BINS), np.uint32(parts), np.uint32(bins), histogram, totals)
    return prefix_sums(engine, name, totals, bins)


def prefix_sums(engine: Engine, name: str, counts: cl.Buffer, length: int) -> tuple[cl.Buffer, int]:
    """Return (buffer `name` of the length + 1 exclusive prefix sums of `counts`, total).

    The sums are of 32 bits; a total that does not fit is told truly, and the sums are then not to be used.
    """
    starts = np.zeros(length + 1, np.uint64)
    with engine.mapped(counts, (length,), np.uint32) as values:
        np.cumsum(values, out=starts[1:])
    return engine.upload(name, starts.astype(np.uint32)), int(starts[-1])
