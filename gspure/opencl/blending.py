"""Blending of tile lists into pixels, and of pixels' weights into contributions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.constants import TILE
from gspure.opencl.binning import TileLists, tile_grid
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Pass
from gspure.opencl.ordering import DepthOrder
from gspure.opencl.projection import Projected
from gspure.opencl.storage import Storage

_GROUP = TILE * TILE


@dataclass(frozen=True)
class Canvas:
    """Device buffers that a frame accumulates in: pixels [H,W,...] and contributions by row [K]."""

    image: cl.Buffer
    transmittance: cl.Buffer
    median_depth: cl.Buffer
    records: cl.Buffer


def prepare_canvas(engine: Engine, frame: Pass, camera: Camera, count: int) -> Canvas:
    """Return buffers for one frame; the contributions start at zero."""
    size = camera.width * camera.height
    rows = count if frame.contributions else 0
    canvas = Canvas(
        engine.buffer("image", 4 * size * frame.channels),
        engine.buffer("transmittance", 4 * size),
        engine.buffer("median_depth", 4 * size * frame.median_depth),
        engine.buffer("records", 16 * rows),
    )
    engine.clear(canvas.records, 16 * rows)
    return canvas


def blend_band(
    engine: Engine,
    frame: Pass,
    camera: Camera,
    projected: Projected,
    lists: TileLists,
    background: NDArray[np.float32],
    canvas: Canvas,
) -> None:
    """Blend one band of tiles into `canvas` (blending_cpu.cl, blending_gpu.cl; contributions.cl)."""
    columns, _ = tile_grid(camera)
    tiles = (lists.band.last - lists.band.first + 1) * columns
    partials = engine.buffer("partials", 12 * lists.capacity * frame.contributions)
    gpu = engine.style == "gpu"
    kernel = engine.kernel(
        "blend_tiles",
        "vector",
        "layout",
        "blending",
        f"blending_{engine.style}",
        CONTRIBUTIONS=int(frame.contributions),
        MEDIAN_DEPTH=int(frame.median_depth),
        **({"BATCH": _batch(engine, frame)} if gpu else {}),
        **frame.layout,
    )
    engine.run(
        kernel,
        tiles * (_GROUP if gpu else 1),
        *(np.int32(camera.width), np.int32(camera.height), np.int32(columns), np.int32(lists.band.first * columns)),
        *(projected.splats, lists.entries, lists.slots, lists.tile_starts, engine.upload("background", background)),
        *(canvas.image, canvas.transmittance, canvas.median_depth, partials),
        group=_GROUP if gpu else 1,
    )


def sum_slots(engine: Engine, order: DepthOrder, storage: Storage, lists: TileLists, canvas: Canvas) -> None:
    """Add what each Gaussian gave to the tiles of a band to its contributions (contributions.cl)."""
    if order.visible:
        engine.run(
            engine.kernel("sum_slots", "contributions"),
            order.visible,
            *(np.uint32(order.visible), order.positions, storage.rows, lists.slot_ranges, engine.buffer("partials", 0)),
            canvas.records,
            group=64,
        )


def _batch(engine: Engine, frame: Pass) -> int:
    """Return how many splats a work-group stages at a time: as many as three quarters of its local memory hold."""
    entry = 4 * (frame.staged_floats + 3 * frame.contributions)
    fitting = engine.device.local_mem_size * 3 // 4 // entry
    return min(_GROUP, 1 << max(int(fitting).bit_length() - 1, 0))
