"""Tile lists of a band of tile rows, and the split of an image into bands whose lists fit in memory (binning.cl)."""

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.constants import FOOTPRINT_FLOATS
from gspure.opencl.engine import Program
from gspure.opencl.frame import Frame
from gspure.opencl.ordering import DepthOrder
from gspure.opencl.projection import Projected
from gspure.opencl.sorting import CHUNK_GROUP, GROUP, chunk_count, first_places, prefix_sums, running_sums, sort_pairs


@dataclass(frozen=True)
class Bounds:
    """Upper bounds of the `entries` of each of the `chunks` contiguous parts of the depth `order`."""

    order: DepthOrder
    entries: cl.Buffer
    chunks: int


@dataclass(frozen=True)
class TileLists:
    """The tile lists of a band of tile rows.

    `entries` [E,2] are pairs (position, slot), sorted by tile and, within a tile, by depth. The list of tile t begins
    at ``tile_starts[t]``. A slot is the place of an entry's partial sums, one of `capacity`; `slot_ranges` [V,2] holds
    the slots of each visible Gaussian, in depth order.
    """

    band: range
    order: DepthOrder
    entries: cl.Buffer
    tile_starts: cl.Buffer
    slot_ranges: cl.Buffer
    capacity: int


def bound_entries(frame: Frame, projected: Projected, order: DepthOrder) -> Bounds:
    """Bound the entries of a whole frame."""
    if frame.engine.style == "gpu":
        groups = max(-(-order.visible // GROUP), 1)
        bounds = frame.engine.buffers.bounds.sized(groups, 2)
        arguments = (order.visible, groups, order.positions, projected.areas, bounds)
        _program(frame).launch("bound_entries", groups * GROUP, *arguments, group=GROUP)
        return Bounds(order, bounds, groups)
    chunks = chunk_count(frame.engine, order.visible)
    bounds = frame.engine.buffers.bounds.sized(chunks)
    arguments = (order.visible, chunks, order.positions, projected.areas, bounds)
    _program(frame).launch("bound_entries", chunks, *arguments, group=CHUNK_GROUP)
    return Bounds(order, bounds, chunks)


def bands(frame: Frame, projected: Projected, bounds: Bounds, entry_budget: int) -> list[range]:
    """Split the tile rows into bands of at most `entry_budget` entries; only a single row may exceed it."""
    _, rows = frame.tiles
    if _most_entries(frame, bounds) <= entry_budget:
        return [range(rows)]
    split = []
    first = 0
    entries = 0  # of the band that begins with row `first`
    for row, bound in enumerate(_entries_per_row(frame, projected, bounds.order)):
        if entries and entries + bound > entry_budget:
            split.append(range(first, row))
            first = row
            entries = 0
        entries += int(bound)
    return [*split, range(first, rows)]


def _most_entries(frame: Frame, bounds: Bounds) -> int:
    dtype = np.uint64 if frame.engine.style == "gpu" else np.uint32
    with frame.engine.mapped(bounds.entries, (bounds.chunks,), dtype) as entries:
        return int(entries.sum(dtype=np.uint64))


def bin_tiles(frame: Frame, projected: Projected, bounds: Bounds, band: range) -> TileLists:
    """Build the tile lists of one band."""
    if frame.engine.style == "gpu":
        return _sort_into_tiles(frame, projected, bounds.order, band)
    engine = frame.engine
    buffers = engine.buffers
    program = _program(frame)
    columns, _ = frame.tiles
    tiles = len(band) * columns
    band_rows = (band[0], band[-1])
    order = bounds.order
    chunks = bounds.chunks
    entry_bounds = _entry_bounds(frame, projected, bounds, band)
    chunk_starts, capacity = prefix_sums(engine, entry_bounds, chunks, buffers.chunk_starts)
    chunk_ends = buffers.chunk_ends.sized(chunks)
    slot_ranges = buffers.slot_ranges.sized(order.visible, 2)
    histogram = buffers.histogram.sized(chunks, tiles)
    emitted = buffers.emitted.sized(capacity, 2)
    entries = buffers.entries.sized(capacity, 2)
    program.launch(
        "emit_entries",
        chunks,
        order.visible,
        chunks,
        columns,
        *band_rows,
        order.positions,
        projected.splats,
        projected.footprints,
        chunk_starts,
        chunk_ends,
        emitted,
        slot_ranges,
        histogram,
        group=CHUNK_GROUP,
    )
    tile_starts = buffers.tile_starts.sized(tiles + 1)
    first_places(engine, histogram, chunks, tiles, tile_starts)
    arguments = (chunk_starts, chunk_ends, emitted, histogram, tile_starts, entries)
    program.launch("scatter_entries", chunks, chunks, tiles, *arguments, group=CHUNK_GROUP)
    return TileLists(band, order, entries, tile_starts, slot_ranges, capacity)


def _entry_bounds(frame: Frame, projected: Projected, bounds: Bounds, band: range) -> cl.Buffer:
    """Return upper bounds of the entries of each chunk in one band."""
    _, rows = frame.tiles
    if len(band) == rows:
        return bounds.entries
    entry_bounds = frame.engine.buffers.band_bounds.sized(bounds.chunks)
    _program(frame).launch(
        "bound_band",
        bounds.chunks,
        bounds.order.visible,
        bounds.chunks,
        band[0],
        band[-1],
        bounds.order.positions,
        projected.footprints,
        entry_bounds,
        group=CHUNK_GROUP,
    )
    return entry_bounds


def _sort_into_tiles(frame: Frame, projected: Projected, order: DepthOrder, band: range) -> TileLists:
    """Build the tile lists of one band by a radix sort (gpu style)."""
    engine = frame.engine
    buffers = engine.buffers
    program = _program(frame)
    columns, _ = frame.tiles
    tiles = len(band) * columns
    band_rows = (band[0], band[-1])
    visible = order.visible
    gaussians = (order.positions, projected.splats, projected.footprints)
    slots = buffers.first_slots.sized(visible + 1)
    program.launch("count_entries", visible, visible, *band_rows, *gaussians, slots)
    running_sums(engine, slots, visible)
    capacity = int(engine.read(slots, (visible + 1,), np.uint32)[-1])
    pairs = (buffers.emitted.sized(capacity, 2), buffers.spare_pairs.sized(capacity, 2))
    slot_positions = buffers.slot_positions.sized(capacity)
    slot_ranges = buffers.slot_ranges.sized(visible, 2)
    emitted = (pairs[0], slot_positions, slot_ranges)
    program.launch("emit_pairs", visible, visible, columns, *band_rows, *gaussians, slots, *emitted)
    length = buffers.chunk_ends.holding(np.array([capacity], np.uint32))
    ordered = sort_pairs(engine, pairs, length, capacity, bits=tiles.bit_length())
    tile_starts = buffers.tile_starts.sized(tiles + 1)
    entries = buffers.entries.sized(capacity, 2)
    pairing = engine.program("layout", "pairs")
    pairing.launch("find_tile_starts", tiles + 1, tiles, length, ordered, tile_starts)
    pairing.launch("place_entries", capacity, length, ordered, slot_positions, entries)
    return TileLists(band, order, entries, tile_starts, slot_ranges, capacity)


def _program(frame: Frame) -> Program:
    return frame.program("layout", "binning")


def _entries_per_row(frame: Frame, projected: Projected, order: DepthOrder) -> NDArray[np.int64]:
    """Return an upper bound of the entries of each tile row, from the tile rectangles."""
    _, rows = frame.tiles
    positions = frame.engine.read(order.positions, (order.visible,), np.uint32)
    shape = (frame.storage.count, FOOTPRINT_FLOATS)
    with frame.engine.mapped(projected.footprints, shape, np.uint32) as words:
        rectangles = words[positions, 5:7]
    first = rectangles & 0xFFFF
    last = rectangles >> 16
    widths = last[:, 0] - first[:, 0] + 1
    begun = np.bincount(first[:, 1], widths, rows + 1)
    ended = np.bincount(last[:, 1] + 1, widths, rows + 1)
    return np.cumsum(begun - ended).astype(np.int64)[:rows]
