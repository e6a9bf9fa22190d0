"""One frame, stage by stage: what `gspure.renderer` does, with an end after each stage."""

from __future__ import annotations

import numpy as np

from gspure.cameras.camera import Camera
from gspure.model import Gaussians
from gspure.opencl.binning import TileLists, bands, bin_tiles, gather_footprints, tile_grid
from gspure.opencl.blending import Canvas, blend_band, prepare_canvas, sum_slots
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Pass
from gspure.opencl.ordering import DepthOrder, sort_by_depth
from gspure.opencl.passes import ENTRY_BUDGET
from gspure.opencl.projection import Projected, project
from gspure.opencl.storage import store, upload_sh_coeffs


class Stages:
    """The stages of one view of one model; each works on what the one before it left."""

    projected: Projected
    order: DepthOrder
    lists: TileLists
    canvas: Canvas

    def __init__(self, engine: Engine, model: Gaussians, camera: Camera, frame: Pass) -> None:
        self.engine, self.model, self.camera, self.frame = engine, model, camera, frame
        self.storage = store(engine, model)
        self.sh_coeffs = upload_sh_coeffs(engine, self.storage, model)
        self.background = np.zeros(max(frame.channels, 1), np.float32)

    def project(self) -> None:
        """Project and shade all Gaussians."""
        self.projected = project(self.engine, self.frame, self.camera, self.storage, self.sh_coeffs)
        self.engine.queue.finish()

    def sort(self) -> None:
        """Order the visible Gaussians by depth."""
        self.order = sort_by_depth(self.engine, self.projected, self.storage)
        self.engine.queue.finish()

    def bin(self) -> None:
        """Build the tile lists."""
        footprints = gather_footprints(self.engine, self.projected, self.order)
        (whole,) = bands(self.engine, footprints, self.order, self.camera, ENTRY_BUDGET)
        arguments = (self.frame, self.projected, footprints, self.order, self.camera, whole)
        self.lists = bin_tiles(self.engine, *arguments)
        self.engine.queue.finish()

    def blend(self, frame: Pass | None = None) -> None:
        """Blend the tile lists, for `frame` instead of the one that was projected if it differs in accumulators."""
        frame = frame or self.frame
        self.canvas = prepare_canvas(self.engine, frame, self.camera, self.storage.count)
        blend_band(self.engine, frame, self.camera, self.projected, self.lists, self.background, self.canvas)
        self.engine.queue.finish()

    def sum(self) -> None:
        """Add up contributions."""
        sum_slots(self.engine, self.order, self.storage, self.lists, self.canvas)
        self.engine.queue.finish()

    def entries(self) -> int:
        """Return the length of all tile lists together."""
        columns, rows = tile_grid(self.camera)
        with self.engine.mapped(self.lists.tile_starts, (columns * rows + 1,), np.uint32) as starts:
            return int(starts[-1])
