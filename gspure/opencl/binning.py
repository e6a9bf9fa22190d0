"""Tile lists of a band of tile rows, and the split of an image into bands whose lists fit in memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.constants import TILE
from gspure.opencl.counting import chunks, first_places, prefix_sums
from gspure.opencl.engine import Engine
from gspure.opencl.ordering import DepthOrder
from gspure.opencl.projection import FOOTPRINT_FLOATS, Projected


@dataclass(frozen=True)
class Band:
    """Tile rows `first` to `last`, both inclusive."""

    first: int
    last: int


@dataclass(frozen=True)
class TileLists:
    """Entries of a band, tile by tile in depth order, and their slots, Gaussian by Gaussian in tile order."""

    band: Band
    entries: cl.Buffer
    slots: cl.Buffer
    tile_starts: cl.Buffer
    slot_starts: cl.Buffer
    count: int


def tile_grid(camera: Camera) -> tuple[int, int]:
    """Return (columns, rows) of tiles."""
    return -(-camera.width // TILE), -(-camera.height // TILE)


def bands(engine: Engine, projected: Projected, order: DepthOrder, camera: Camera, entry_budget: int) -> Iterator[Band]:
    """Split the tile rows so that no band can hold more than `entry_budget` entries, unless a single row does.

    The bound of a Gaussian is its tile rectangle.
    """
    columns, rows = tile_grid(camera)
    if order.visible * columns * rows <= entry_budget:
        yield Band(0, rows - 1)
        return
    row_bounds = _entries_per_row(engine, projected, order, rows)
    first, held = 0, 0
    for row in range(rows):
        if held and held + row_bounds[row] > entry_budget:
            yield Band(first, row - 1)
            first, held = row, 0
        held += int(row_bounds[row])
    yield Band(first, rows - 1)


def _entries_per_row(engine: Engine, projected: Projected, order: DepthOrder, rows: int) -> NDArray[np.int64]:
    """Return an upper bound of the entries of each tile row, from the tile rectangles."""
    visible = engine.read(order.rows, (order.visible,), np.uint32)
    with engine.mapped(projected.footprints, (projected.count, FOOTPRINT_FLOATS), np.uint32) as footprints:
        rectangles = footprints[visible, 5:7]
    first, last = rectangles & 0xFFFF, rectangles >> 16
    widths = last[:, 0] - first[:, 0] + 1
    begun = np.bincount(first[:, 1], widths, rows + 1)
    ended = np.bincount(last[:, 1] + 1, widths, rows + 1)
    return np.cumsum(begun - ended).astype(np.int64)[:rows]


def bin_tiles(engine: Engine, projected: Projected, order: DepthOrder, camera: Camera, band: Band) -> TileLists:
    """Build the tile lists of one band (binning.cl)."""
    columns, _ = tile_grid(camera)
    tiles = (band.last - band.first + 1) * columns
    visible, parts = order.visible, chunks(engine, order.visible)
    ordered = engine.buffer("ordered_footprints", 4 * FOOTPRINT_FLOATS * visible)
    counts = engine.buffer("counts", 4 * visible)
    histogram = engine.buffer("histogram", 4 * parts * tiles)
    shape = (np.uint32(visible), np.uint32(parts), np.int32(columns), np.int32(band.first), np.int32(band.last))
    count_tiles, scatter_tiles = (
        engine.kernel(name, "layout", "binning", RAY=0, CHANNELS=0) for name in ("count_tiles", "scatter_tiles")
    )
    engine.run(count_tiles, parts, *shape, order.rows, projected.footprints, ordered, counts, histogram)
    tile_starts, count = first_places(engine, "tile_starts", histogram, parts, tiles)
    slot_starts, _ = prefix_sums(engine, "slot_starts", counts, visible)
    entries, slots = engine.buffer("entries", 4 * count), engine.buffer("slots", 4 * count)
    engine.run(scatter_tiles, parts, *shape, order.rows, ordered, histogram, tile_starts, slot_starts, entries, slots)
    return TileLists(band, entries, slots, tile_starts, slot_starts, count)
