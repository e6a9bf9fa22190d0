"""Blending along the rays through points: opacities at them (GOF), or contributions of the energy "center_ray"."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Indices
from gspure.cameras.camera import Camera, points_shown
from gspure.constants import TILE, TRANSMITTANCE_MIN
from gspure.opencl.binning import TileLists, bands, bin_tiles, bound_entries
from gspure.opencl.engine import LANES, Engine
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.ordering import sort_by_depth
from gspure.opencl.projection import project
from gspure.opencl.storage import Rows, Storage

FINER = 4  # side of a tile of pixels over that of a tile of points: smaller tiles have shorter lists; ours


class PointRays:
    """A view prepared for blending along its rays through points; usable until the engine's next frame."""

    def __init__(self, engine: Engine, storage: Storage, camera: Camera, entry_budget: int) -> None:
        fine = camera.resized(FINER * camera.width, FINER * camera.height)
        self.frame = Frame(engine, storage, fine, Traversal("ray", points=True))
        self.projected = project(self.frame)
        order = sort_by_depth(engine, storage, self.projected.depth_keys)
        self.bounds = bound_entries(self.frame, self.projected, order)
        self.bands = bands(self.frame, self.projected, self.bounds, entry_budget)
        self.lists: TileLists | None = None  # of the last band

    def opacities(self, points: NDArray[Any], least: float = TRANSMITTANCE_MIN) -> Float32:
        """Return the opacity [P] blended up to each of the `points` [P,3]; 1 where the view does not show it.

        Blending ends at transmittances below `least`: opacities above 1 - `least` are lower bounds.
        """
        return self._blended(points, None, least)

    def contributions(self, centres: NDArray[Any], positions: Rows) -> Float32:
        """Return the contributions [P] of Gaussians, each on the ray through its centre.

        `centres` [P,3] are in world units, `positions` [P] are those of the Gaussians in storage. A contribution is 0
        if the view does not show the centre.
        """
        return self._blended(centres, positions, TRANSMITTANCE_MIN)

    def _blended(self, points: NDArray[Any], owners: Rows | None, least: float) -> Float32:
        columns, _ = self.frame.tiles
        rows, tiles, positions = _by_tile(self.frame, points)
        values = np.full(len(points), owners is None, np.float32)
        with self.frame.engine.exclusive():
            for band in self.bands:
                inside = slice(*np.searchsorted(tiles, (band.start * columns, band.stop * columns)))
                band_rows = rows[inside]
                if len(band_rows):
                    band_owners = None if owners is None else owners[band_rows]
                    values[band_rows] = self._blend_band(band, tiles[inside], positions[inside], band_owners, least)
        return values

    def _blend_band(
        self, band: range, tiles: Indices, positions: Float32, owners: Rows | None, least: float
    ) -> Float32:
        """Return the values of a band's points."""
        frame = self.frame
        engine = frame.engine
        buffers = engine.buffers
        if self.lists is None or self.lists.band != band:
            self.lists = bin_tiles(frame, self.projected, self.bounds, band)
        tiles, sources = _work_items(tiles, LANES[engine.style])
        computed = buffers.point_values.sized(*sources.shape)
        frame.program("vector", "layout", "blending", "opacity_field").launch(
            "blend_points" if owners is None else "blend_centres",
            len(tiles),
            len(tiles),
            buffers.points.holding(positions[sources].transpose(0, 2, 1)),
            buffers.point_tiles.holding((tiles - band.start * frame.tiles[0]).astype(np.uint32)),
            self.projected.splats,
            self.lists.entries,
            self.lists.tile_starts,
            computed,
            least if owners is None else buffers.point_owners.holding(owners[sources]),
        )
        values = np.empty(len(positions), np.float32)
        values[sources] = engine.read(computed, sources.shape, np.float32)
        return values


def _by_tile(frame: Frame, points: NDArray[np.floating]) -> tuple[Indices, Indices, Float32]:
    """Return the points that a view shows, sorted by tile: rows [S], tiles [S] and positions (u, v, z) [S,3]."""
    rows, positions = points_shown(frame.camera, points)
    columns, lines = frame.tiles
    column, row = (positions[:, :2].astype(np.int32) // np.int32(TILE)).T
    tiles = row * np.int32(columns) + column
    fits_16_bits = columns * lines < 1 << 16  # numpy sorts 16-bit integers by radix
    order = np.argsort(tiles.astype(np.uint16) if fits_16_bits else tiles, kind="stable")
    return rows[order], tiles[order], positions[order].astype(np.float32)


def _work_items(tiles: Indices, lanes: int) -> tuple[Indices, Indices]:
    """Assign points to work-items; return the tile [I] and the points [I,lanes] of each work-item.

    `tiles` [S] has the tile of each point, ascending. The last point of a tile fills the rest of its last work-item.
    """
    present, starts, counts = np.unique(tiles, return_index=True, return_counts=True)
    items = -(-counts // lanes)
    owners = np.repeat(np.arange(len(present)), items)
    within = np.arange(len(owners)) - np.repeat(np.cumsum(items) - items, items)
    sources = (starts[owners] + lanes * within)[:, None] + np.arange(lanes)
    return present[owners], np.minimum(sources, (starts + counts - 1)[owners, None])
