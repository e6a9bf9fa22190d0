"""A frame from end to end: forward to pixels, and backward from their gradient."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from gspure.cameras.camera import Camera
from gspure.opencl.binning import Band, Footprints, TileLists, bands, bin_tiles, gather_footprints
from gspure.opencl.blending import Canvas, blend_band, prepare_canvas, sum_slots
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Pass
from gspure.opencl.gradients import DeviceGradients, blend_band_backward, clear_splat_gradients, project_backward
from gspure.opencl.ordering import DepthOrder, sort_by_depth
from gspure.opencl.projection import Projected, project
from gspure.opencl.storage import Storage

ENTRY_BUDGET = 1 << 26
"""Most tile entries held at a time; at 28 bytes each, 1.9 GB. Larger frames are rendered in bands, to the same bits."""


@dataclass(frozen=True)
class Rendered:
    """A frame on the device, valid until the engine renders the next one; `lists` are good if it has one band."""

    frame: Pass
    camera: Camera
    channels: cl.Buffer | None
    projected: Projected
    order: DepthOrder
    footprints: Footprints
    bands: tuple[Band, ...]
    lists: TileLists
    canvas: Canvas


def forward(
    engine: Engine,
    storage: Storage,
    frame: Pass,
    camera: Camera,
    *,
    channels: cl.Buffer | None = None,
    background: Sequence[float] = (0.0,),
    entry_budget: int,
) -> Rendered:
    """Render one frame; `channels` holds SH coefficients or features, as `frame` says."""
    if len(background) != max(frame.channels, 1):
        raise ValueError(f"background has {len(background)} values for {frame.channels} channels")
    projected = project(engine, frame, camera, storage, channels)
    order = sort_by_depth(engine, projected, storage)
    canvas = prepare_canvas(engine, frame, camera, storage.count)
    footprints = gather_footprints(engine, projected, order)
    split = tuple(bands(engine, footprints, order, camera, entry_budget))
    for band in split:
        lists = bin_tiles(engine, frame, projected, footprints, order, camera, band)
        blend_band(engine, frame, camera, projected, lists, np.asarray(background, np.float32), canvas)
        if frame.contributions:
            sum_slots(engine, order, storage, lists, canvas)
    return Rendered(frame, camera, channels, projected, order, footprints, split, lists, canvas)


def backward(engine: Engine, storage: Storage, seen: Rendered, image_gradient: cl.Buffer) -> DeviceGradients:
    """Carry dL/dimage of the last frame back to the Gaussians' parameters (energy "ewa")."""
    frame, camera = seen.frame, seen.camera
    clear_splat_gradients(engine, frame, storage)
    for band in seen.bands:
        lists = seen.lists
        if len(seen.bands) > 1:  # all bands share the lists' buffers
            lists = bin_tiles(engine, frame, seen.projected, seen.footprints, seen.order, camera, band)
        blend_band_backward(engine, frame, camera, seen.projected, seen.order, lists, seen.canvas.image, image_gradient)
    return project_backward(engine, frame, camera, storage, seen.channels, seen.projected)
