"""Opacity at points in space, as one view sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.cameras.projection import points_shown
from gspure.constants import TILE
from gspure.opencl.binning import TileLists, bands, bin_tiles, gather_footprints, tile_grid
from gspure.opencl.engine import LANES, Engine
from gspure.opencl.frame import Pass
from gspure.opencl.ordering import sort_by_depth
from gspure.opencl.projection import Projected, project
from gspure.opencl.storage import Storage

FINER = 4
"""Tiles of points are this many times smaller than those of pixels: lists are shorter, opacities the same. Ours."""

_FRAME = Pass("ray", points=True)

Float32 = NDArray[np.float32]


@dataclass(frozen=True)
class Placed:
    """Those S of the points that a view shows, tile by tile: `rows`, `tiles`, and `positions` (u, v, z) [S,3]."""

    rows: NDArray[np.intp]
    tiles: NDArray[np.intp]
    positions: Float32


def opacities_at(
    engine: Engine, storage: Storage, camera: Camera, points: NDArray[np.floating], entry_budget: int
) -> Float32:
    """Return how much is blended before and at each of the `points` [P,3]; 1 where the view does not show it."""
    fine = camera.resized(FINER * camera.width, FINER * camera.height)
    placed = place(fine, points)
    opacities = np.ones(len(points), np.float32)
    if not len(placed.rows):
        return opacities
    projected = project(engine, _FRAME, fine, storage, None)
    order = sort_by_depth(engine, projected, storage)
    footprints = gather_footprints(engine, projected, order)
    columns, _ = tile_grid(fine)
    for band in bands(engine, footprints, order, fine, entry_budget):
        begin, end = np.searchsorted(placed.tiles, (band.first * columns, (band.last + 1) * columns))
        if begin < end:
            lists = bin_tiles(engine, _FRAME, projected, footprints, order, fine, band)
            inside = Placed(*(part[begin:end] for part in vars(placed).values()))
            opacities[inside.rows] = _blend_points(engine, projected, lists, columns, inside)
    return opacities


def place(camera: Camera, points: NDArray[np.floating]) -> Placed:
    """Project points, and sort those that the view shows by tile."""
    rows, positions = points_shown(camera, points)
    columns, _ = tile_grid(camera)
    tiles = (positions[:, 1] // TILE).astype(np.intp) * columns + (positions[:, 0] // TILE).astype(np.intp)
    order = np.argsort(tiles, kind="stable")
    return Placed(rows[order], tiles[order], positions[order].astype(np.float32))


def _blend_points(engine: Engine, projected: Projected, lists: TileLists, columns: int, placed: Placed) -> Float32:
    """Return the opacity at each of a band's points (opacity_field.cl)."""
    lanes = LANES[engine.style]
    tiles, sources = _dealt(placed.tiles, lanes)
    positions = placed.positions[sources].transpose(0, 2, 1)
    opacities = engine.buffer("point_opacities", 4 * sources.size)
    engine.run(
        engine.kernel("blend_points", "vector", "layout", "blending", "opacity_field", **_FRAME.layout),
        len(tiles),
        *(np.uint32(len(tiles)), engine.upload("points", positions)),
        engine.upload("point_tiles", (tiles - lists.band.first * columns).astype(np.uint32)),
        *(projected.splats, lists.entries, lists.tile_starts, opacities),
    )
    found = np.empty(len(placed.rows), np.float32)
    found[sources] = engine.read(opacities, sources.shape, np.float32)
    return found


def _dealt(tiles: NDArray[np.intp], lanes: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Deal points, given the ascending tile of each, to work-items of one tile: its tile [I], its points [I,lanes].

    The last point of a tile fills up its last work-item.
    """
    present, starts, counts = np.unique(tiles, return_index=True, return_counts=True)
    items = -(-counts // lanes)
    owners = np.repeat(np.arange(len(present)), items)
    first = np.arange(len(owners)) - np.repeat(np.cumsum(items) - items, items)
    sources = (starts[owners] + lanes * first)[:, None] + np.arange(lanes)
    return present[owners], np.minimum(sources, (starts + counts - 1)[owners, None])
