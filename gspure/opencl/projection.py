"""Projection of a model into one view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from gspure.cameras.camera import Camera
from gspure.opencl.engine import LANES, Engine
from gspure.opencl.frame import Pass
from gspure.opencl.storage import Storage

FOOTPRINT_FLOATS = 8


@dataclass(frozen=True)
class Projected:
    """What projection leaves on the device, by position [K]; depth keys mark what is NOT_VISIBLE (layout.cl)."""

    count: int
    splats: cl.Buffer
    footprints: cl.Buffer
    depth_keys: cl.Buffer


def project(engine: Engine, frame: Pass, camera: Camera, storage: Storage, channels: cl.Buffer | None) -> Projected:
    """Project all Gaussians; `channels` holds SH coefficients or features, as `frame` says."""
    count = storage.count
    kernel = engine.kernel(
        "project",
        "vector",
        "layout",
        "spherical_harmonics",
        "projection",
        SH_DEGREE=frame.sh_degree,
        CHANNEL_ATTRIBUTES=frame.channel_attributes,
        **frame.layout,
    )
    splats = engine.buffer("splats", 4 * frame.splat_floats * count)
    footprints = engine.buffer("footprints", 4 * FOOTPRINT_FLOATS * count)
    depth_keys = engine.buffer("depth_keys", 4 * count)
    numbers = engine.upload("camera", np.concatenate([camera.numbers, camera.centre]).astype(np.float32))
    if count:
        items = -(-count // LANES[engine.style])
        engine.run(
            kernel,
            items,
            np.uint32(count),
            np.int32(camera.width),
            np.int32(camera.height),
            numbers,
            storage.geometry,
            channels or storage.geometry,
            splats,
            footprints,
            depth_keys,
        )
    return Projected(count, splats, footprints, depth_keys)
