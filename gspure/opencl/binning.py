"""Tile lists of a band of tile rows, and the split of an image into bands whose lists fit in memory (binning.cl)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.constants import FOOTPRINT_FLOATS
from gspure.opencl.counting import chunks, first_places, prefix_sums
from gspure.opencl.engine import Engine, Program
from gspure.opencl.frame import Frame
from gspure.opencl.ordering import DepthOrder
from gspure.opencl.projection import Projected


@dataclass(frozen=True)
class Footprints:
    """Footprints of the visible Gaussians in depth `order`, and the most entries of each of their `chunks`."""

    order: DepthOrder
    ordered: cl.Buffer
    bounds: cl.Buffer
    chunks: int


@dataclass(frozen=True)
class TileLists:
    """Lists of a band of tile rows: `entries` [E,2] (position, slot) by tile from `tile_starts` on, in depth order.

    A slot is one of `capacity` places for an entry's partial sums; `slot_ranges` [V,2] holds those of each visible
    Gaussian, in depth order.
    """

    band: range
    order: DepthOrder
    entries: cl.Buffer
    tile_starts: cl.Buffer
    slot_ranges: cl.Buffer
    capacity: int


def gather_footprints(frame: Frame, projected: Projected, order: DepthOrder) -> Footprints:
    """Return the footprints of the visible Gaussians in depth order."""
    buffers, parts = frame.engine.buffers, chunks(frame.engine, order.visible)
    ordered, bounds = buffers.ordered_footprints.sized(order.visible, FOOTPRINT_FLOATS), buffers.bounds.sized(parts)
    arguments = (order.visible, parts, order.positions, projected.footprints, ordered, bounds)
    _program(frame).launch("gather_footprints", parts, *arguments)
    return Footprints(order, ordered, bounds, parts)


def bands(frame: Frame, footprints: Footprints, entry_budget: int) -> list[range]:
    """Split the tile rows so that no band can hold more than `entry_budget` entries, unless a single row does."""
    _, rows = frame.tiles
    with frame.engine.mapped(footprints.bounds, (footprints.chunks,), np.uint32) as bounds:
        most = int(bounds.sum(dtype=np.uint64))
    if most <= entry_budget:
        return [range(rows)]
    split, first, held = [], 0, 0
    for row, bound in enumerate(_entries_per_row(frame.engine, footprints, rows)):
        if held and held + bound > entry_budget:
            split.append(range(first, row))
            first, held = row, 0
        held += int(bound)
    return [*split, range(first, rows)]


def bin_tiles(frame: Frame, projected: Projected, footprints: Footprints, band: range) -> TileLists:
    """Build the tile lists of one band."""
    engine, buffers, program = frame.engine, frame.engine.buffers, _program(frame)
    columns, rows = frame.tiles
    tiles, band_rows = len(band) * columns, (band[0], band[-1])
    order, parts = footprints.order, footprints.chunks
    shape = (order.visible, parts)
    bounds = footprints.bounds
    if len(band) < rows:
        bounds = buffers.band_bounds.sized(parts)
        program.launch("bound_entries", parts, *shape, *band_rows, footprints.ordered, bounds)
    chunk_starts, capacity = prefix_sums(engine, bounds, parts, buffers.chunk_starts)
    chunk_ends, slot_ranges = buffers.chunk_ends.sized(parts), buffers.slot_ranges.sized(order.visible, 2)
    histogram = buffers.histogram.sized(parts, tiles)
    emitted, entries = buffers.emitted.sized(capacity, 2), buffers.entries.sized(capacity, 2)
    program.launch(
        "emit_entries",
        parts,
        *(*shape, columns, *band_rows, order.positions, projected.splats, footprints.ordered),
        *(chunk_starts, chunk_ends, emitted, slot_ranges, histogram),
    )
    tile_starts, _ = first_places(engine, histogram, parts, tiles, buffers.tile_starts)
    arguments = (chunk_starts, chunk_ends, emitted, histogram, tile_starts, entries)
    program.launch("scatter_entries", parts, parts, tiles, *arguments)
    return TileLists(band, order, entries, tile_starts, slot_ranges, capacity)


def _program(frame: Frame) -> Program:
    return frame.program("layout", "binning")


def _entries_per_row(engine: Engine, footprints: Footprints, rows: int) -> NDArray[np.int64]:
    """Return an upper bound of the entries of each tile row, from the tile rectangles."""
    with engine.mapped(footprints.ordered, (footprints.order.visible, FOOTPRINT_FLOATS), np.uint32) as words:
        first, last = words[:, 5:7] & 0xFFFF, words[:, 5:7] >> 16
    widths = last[:, 0] - first[:, 0] + 1
    begun = np.bincount(first[:, 1], widths, rows + 1)
    ended = np.bincount(last[:, 1] + 1, widths, rows + 1)
    return np.cumsum(begun - ended).astype(np.int64)[:rows]
