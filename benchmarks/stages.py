"""One frame, stage by stage, as in `gspure.renderer`, but the queue is finished after each stage."""

from dataclasses import replace

import numpy as np

from gspure.cameras.camera import Camera
from gspure.model import Gaussians
from gspure.opencl.binning import TileLists, bands, bin_tiles, bound_entries
from gspure.opencl.blending import Canvas, blend_band, prepare_canvas, sum_slots
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.ordering import DepthOrder, sort_by_depth
from gspure.opencl.passes import ENTRY_BUDGET
from gspure.opencl.projection import Projected, project
from gspure.opencl.storage import store, upload_sh_coeffs


class Stages:
    """The stages of one view of one model; each uses the results of the stages before it."""

    projected: Projected
    order: DepthOrder
    lists: TileLists
    canvas: Canvas

    def __init__(self, engine: Engine, model: Gaussians, camera: Camera, traversal: Traversal) -> None:
        self.engine = engine
        self.model = model
        storage = store(engine, model)
        self.frame = Frame(engine, storage, camera, traversal, upload_sh_coeffs(engine, storage, model))
        self.background = np.zeros(max(traversal.channels, 1), np.float32)

    def project(self) -> None:
        """Project and shade all Gaussians."""
        self.projected = project(self.frame)
        self.engine.queue.finish()

    def sort(self) -> None:
        """Order the visible Gaussians by depth."""
        self.order = sort_by_depth(self.engine, self.frame.storage, self.projected.depth_keys)
        self.engine.queue.finish()

    def bin(self) -> None:
        """Build the tile lists."""
        bounds = bound_entries(self.frame, self.projected, self.order)
        (whole,) = bands(self.frame, self.projected, bounds, ENTRY_BUDGET)
        self.lists = bin_tiles(self.frame, self.projected, bounds, whole)
        self.engine.queue.finish()

    def blend(self, *, contributions: bool | None = None) -> None:
        """Blend the tile lists; `contributions` replaces the setting of the traversal."""
        frame = self.frame
        if contributions is not None:
            frame = replace(frame, traversal=replace(frame.traversal, contributions=contributions))
        self.canvas = prepare_canvas(frame)
        blend_band(frame, self.projected, self.lists, self.background, self.canvas)
        self.engine.queue.finish()

    def sum(self) -> None:
        """Add up contributions."""
        sum_slots(self.frame, self.lists, self.canvas)
        self.engine.queue.finish()

    def entries(self) -> int:
        """Return the total length of all tile lists."""
        columns, rows = self.frame.tiles
        with self.engine.mapped(self.lists.tile_starts, (columns * rows + 1,), np.uint32) as starts:
            return int(starts[-1])
