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
from gspure.opencl.sorting import CHUNK_GROUP, GROUP, chunks, first_places, prefix_sums, running_sums, sort_pairs


@dataclass(frozen=True)
class Bounds:
    """The most entries of each of the `chunks` that the visible Gaussians in depth `order` are cut into."""

    order: DepthOrder
    entries: cl.Buffer
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


def bound_entries(frame: Frame, projected: Projected, order: DepthOrder) -> Bounds:
    """Bound the entries of a whole frame."""
    if frame.engine.style == "gpu":
        groups = max(-(-order.visible // GROUP), 1)
        bounds = frame.engine.buffers.bounds.sized(groups, 2)
        arguments = (order.visible, groups, order.positions, projected.areas, bounds)
        _program(frame).launch("bound_entries", groups * GROUP, *arguments, group=GROUP)
        return Bounds(order, bounds, groups)
    parts = chunks(frame.engine, order.visible)
    bounds = frame.engine.buffers.bounds.sized(parts)
    _program(frame).launch(
        "bound_entries", parts, order.visible, parts, order.positions, projected.areas, bounds, group=CHUNK_GROUP
    )
    return Bounds(order, bounds, parts)


def bands(frame: Frame, projected: Projected, bounds: Bounds, entry_budget: int) -> list[range]:
    """Split the tile rows so that no band can hold more than `entry_budget` entries, unless a single row does."""
    _, rows = frame.tiles
    if _most_entries(frame, bounds) <= entry_budget:
        return [range(rows)]
    split, first, held = [], 0, 0
    for row, bound in enumerate(_entries_per_row(frame, projected, bounds.order)):
        if held and held + bound > entry_budget:
            split.append(range(first, row))
            first, held = row, 0
        held += int(bound)
    return [*split, range(first, rows)]


def _most_entries(frame: Frame, bounds: Bounds) -> int:
    dtype = np.uint64 if frame.engine.style == "gpu" else np.uint32
    with frame.engine.mapped(bounds.entries, (bounds.chunks,), dtype) as entries:
        return int(entries.sum(dtype=np.uint64))


def bin_tiles(frame: Frame, projected: Projected, bounds: Bounds, band: range) -> TileLists:
    """Build the tile lists of one band."""
    if frame.engine.style == "gpu":
        return _sort_into_tiles(frame, projected, bounds.order, band)
    engine, buffers, program = frame.engine, frame.engine.buffers, _program(frame)
    columns, rows = frame.tiles
    tiles, band_rows = len(band) * columns, (band[0], band[-1])
    order, parts = bounds.order, bounds.chunks
    shape, footprints = (order.visible, parts), projected.footprints
    most = bounds.entries
    if len(band) < rows:
        most = buffers.band_bounds.sized(parts)
        program.launch("bound_band", parts, *shape, *band_rows, order.positions, footprints, most, group=CHUNK_GROUP)
    chunk_starts, capacity = prefix_sums(engine, most, parts, buffers.chunk_starts)
    chunk_ends, slot_ranges = buffers.chunk_ends.sized(parts), buffers.slot_ranges.sized(order.visible, 2)
    histogram = buffers.histogram.sized(parts, tiles)
    emitted, entries = buffers.emitted.sized(capacity, 2), buffers.entries.sized(capacity, 2)
    program.launch(
        "emit_entries",
        parts,
        *(*shape, columns, *band_rows, order.positions, projected.splats, footprints),
        *(chunk_starts, chunk_ends, emitted, slot_ranges, histogram),
        group=CHUNK_GROUP,
    )
    tile_starts = buffers.tile_starts.sized(tiles + 1)
    first_places(engine, histogram, parts, tiles, tile_starts)
    arguments = (chunk_starts, chunk_ends, emitted, histogram, tile_starts, entries)
    program.launch("scatter_entries", parts, parts, tiles, *arguments, group=CHUNK_GROUP)
    return TileLists(band, order, entries, tile_starts, slot_ranges, capacity)


def _sort_into_tiles(frame: Frame, projected: Projected, order: DepthOrder, band: range) -> TileLists:
    """Build the tile lists of one band by a radix sort (gpu style)."""
    engine, buffers, program = frame.engine, frame.engine.buffers, _program(frame)
    columns, _ = frame.tiles
    tiles, band_rows, visible = len(band) * columns, (band[0], band[-1]), order.visible
    places = (order.positions, projected.splats, projected.footprints)
    slots = buffers.first_slots.sized(visible + 1)
    program.launch("count_entries", visible, visible, *band_rows, *places, slots)
    running_sums(engine, slots, visible)
    capacity = int(engine.read(slots, (visible + 1,), np.uint32)[-1])
    pairs = buffers.emitted.sized(capacity, 2), buffers.spare_pairs.sized(capacity, 2)
    slot_positions, slot_ranges = buffers.slot_positions.sized(capacity), buffers.slot_ranges.sized(visible, 2)
    emitted = (pairs[0], slot_positions, slot_ranges)
    program.launch("emit_pairs", visible, visible, columns, *band_rows, *places, slots, *emitted)
    length = buffers.chunk_ends.holding(np.array([capacity], np.uint32))
    ordered = sort_pairs(engine, pairs, length, capacity, bits=tiles.bit_length())
    tile_starts, entries = buffers.tile_starts.sized(tiles + 1), buffers.entries.sized(capacity, 2)
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
    first, last = rectangles & 0xFFFF, rectangles >> 16
    widths = last[:, 0] - first[:, 0] + 1
    begun = np.bincount(first[:, 1], widths, rows + 1)
    ended = np.bincount(last[:, 1] + 1, widths, rows + 1)
    return np.cumsum(begun - ended).astype(np.int64)[:rows]
