"""Tile lists of a band of tile rows, and the split of an image into bands whose lists fit in memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.constants import TILE
from gspure.opencl.counting import chunks, first_places, prefix_sums
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Pass
from gspure.opencl.ordering import DepthOrder
from gspure.opencl.projection import FOOTPRINT_FLOATS, Projected


@dataclass(frozen=True)
class Band:
    """Tile rows `first` to `last`, both inclusive."""

    first: int
    last: int


@dataclass(frozen=True)
class Footprints:
    """Footprints of the visible Gaussians in depth order, and how many entries each chunk of them can have at most."""

    ordered: cl.Buffer
    bounds: cl.Buffer


@dataclass(frozen=True)
class TileLists:
    """Lists of a band: `entries` (positions) and `slots`, tile by tile in depth order from `tile_starts` on.

    A slot is one of `capacity` places in which an entry's partial sums are kept; `slot_ranges` [visible][2] holds those
    of each Gaussian, in depth order.
    """

    band: Band
    entries: cl.Buffer
    slots: cl.Buffer
    tile_starts: cl.Buffer
    slot_ranges: cl.Buffer
    capacity: int


def tile_grid(camera: Camera) -> tuple[int, int]:
    """Return (columns, rows) of tiles."""
    return -(-camera.width // TILE), -(-camera.height // TILE)


def gather_footprints(engine: Engine, projected: Projected, order: DepthOrder) -> Footprints:
    """Return the footprints of the visible Gaussians in depth order."""
    parts = chunks(engine, order.visible)
    footprints = Footprints(
        engine.buffer("ordered_footprints", 4 * FOOTPRINT_FLOATS * order.visible), engine.buffer("bounds", 4 * parts)
    )
    engine.run(
        _kernel(engine, "gather_footprints"),
        parts,
        *(np.uint32(order.visible), np.uint32(parts), order.positions, projected.footprints),
        *(footprints.ordered, footprints.bounds),
    )
    return footprints


def bands(engine: Engine, footprints: Footprints, order: DepthOrder, camera: Camera, entry_budget: int) -> list[Band]:
    """Split the tile rows so that no band can hold more than `entry_budget` entries, unless a single row does."""
    _, rows = tile_grid(camera)
    with engine.mapped(footprints.bounds, (chunks(engine, order.visible),), np.uint32) as bounds:
        most = int(bounds.sum(dtype=np.uint64))
    if most <= entry_budget:
        return [Band(0, rows - 1)]
    found, first, held = [], 0, 0
    for row, bound in enumerate(_entries_per_row(engine, footprints.ordered, order, rows)):
        if held and held + bound > entry_budget:
            found.append(Band(first, row - 1))
            first, held = row, 0
        held += int(bound)
    return [*found, Band(first, rows - 1)]


def bin_tiles(
    engine: Engine,
    frame: Pass,
    projected: Projected,
    footprints: Footprints,
    order: DepthOrder,
    camera: Camera,
    band: Band,
) -> TileLists:
    """Build the tile lists of one band (binning.cl)."""
    columns, rows = tile_grid(camera)
    tiles = (band.last - band.first + 1) * columns
    visible, parts = order.visible, chunks(engine, order.visible)
    bounds = footprints.bounds if band == Band(0, rows - 1) else _bounds_of(engine, footprints, order, band)
    chunk_starts, capacity = prefix_sums(engine, "chunk_starts", bounds, parts)
    chunk_ends = engine.buffer("chunk_ends", 4 * parts)
    slot_ranges = engine.buffer("slot_ranges", 8 * visible)
    histogram = engine.buffer("histogram", 4 * parts * tiles)
    emitted_tiles, emitted_positions, entries, slots = (
        engine.buffer(name, 4 * capacity) for name in ("emitted_tiles", "emitted_positions", "entries", "slots")
    )
    engine.run(
        engine.kernel("emit_entries", "layout", "binning", **frame.layout),
        parts,
        *(np.uint32(visible), np.uint32(parts), np.int32(columns), np.int32(band.first), np.int32(band.last)),
        *(order.positions, projected.splats, footprints.ordered, chunk_starts, chunk_ends),
        *(emitted_tiles, emitted_positions, slot_ranges, histogram),
    )
    tile_starts, _ = first_places(engine, "tile_starts", histogram, parts, tiles)
    engine.run(
        _kernel(engine, "scatter_entries"),
        parts,
        *(np.uint32(parts), np.uint32(tiles), chunk_starts, chunk_ends, emitted_tiles, emitted_positions),
        *(histogram, tile_starts, entries, slots),
    )
    return TileLists(band, entries, slots, tile_starts, slot_ranges, capacity)


def _kernel(engine: Engine, name: str) -> cl.Kernel:
    return engine.kernel(name, "layout", "binning", RAY=0, CHANNELS=0)


def _bounds_of(engine: Engine, footprints: Footprints, order: DepthOrder, band: Band) -> cl.Buffer:
    """Return how many entries each chunk can have at most in one of several bands."""
    parts = chunks(engine, order.visible)
    bounds = engine.buffer("band_bounds", 4 * parts)
    engine.run(
        _kernel(engine, "bound_entries"),
        parts,
        *(np.uint32(order.visible), np.uint32(parts), np.int32(band.first), np.int32(band.last)),
        *(footprints.ordered, bounds),
    )
    return bounds


def _entries_per_row(engine: Engine, footprints: cl.Buffer, order: DepthOrder, rows: int) -> NDArray[np.int64]:
    """Return an upper bound of the entries of each tile row, from the tile rectangles."""
    with engine.mapped(footprints, (order.visible, FOOTPRINT_FLOATS), np.uint32) as words:
        first, last = words[:, 5:7] & 0xFFFF, words[:, 5:7] >> 16
    widths = last[:, 0] - first[:, 0] + 1
    begun = np.bincount(first[:, 1], widths, rows + 1)
    ended = np.bincount(last[:, 1] + 1, widths, rows + 1)
    return np.cumsum(begun - ended).astype(np.int64)[:rows]
