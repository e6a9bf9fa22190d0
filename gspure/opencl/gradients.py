"""The backward pass: from the gradient of an image to the gradients of everything it was rendered from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.opencl.binning import TileLists, tile_grid
from gspure.opencl.engine import LANES, Engine
from gspure.opencl.frame import Pass
from gspure.opencl.ordering import DepthOrder
from gspure.opencl.projection import Projected
from gspure.opencl.storage import BLOCK, GEOMETRY_ATTRIBUTES, Storage

MOMENTS = 6  # layout.cl
_GROUP = 256


@dataclass(frozen=True)
class DeviceGradients:
    """Gradients on the device, in storage order and blocks: geometry (11), channels, projected centre (2)."""

    geometry: cl.Buffer
    channels: cl.Buffer
    centres: cl.Buffer


def clear_splat_gradients(engine: Engine, frame: Pass, storage: Storage) -> None:
    """Set the gradients that the bands of a frame add up to zero."""
    nbytes = _blocked_bytes(storage, MOMENTS + frame.channels)
    engine.clear(engine.buffer("splat_gradients", nbytes), nbytes)


def blend_band_backward(
    engine: Engine,
    frame: Pass,
    camera: Camera,
    projected: Projected,
    order: DepthOrder,
    lists: TileLists,
    image: cl.Buffer,
    image_gradient: cl.Buffer,
) -> None:
    """Walk one band of tiles backward (blending_backward_*.cl) and add up each Gaussian's slots (gradients.cl)."""
    columns, _ = tile_grid(camera)
    tiles = (lists.band.last - lists.band.first + 1) * columns
    gpu = engine.style == "gpu"
    slot_gradients = engine.buffer("slot_gradients", 4 * (MOMENTS + frame.channels) * lists.capacity)
    engine.run(
        engine.kernel(
            "blend_tiles_backward",
            *("vector", "layout", "blending", f"blending_backward_{engine.style}"),
            **frame.layout,
        ),
        tiles * (_GROUP if gpu else 1),
        *(np.int32(camera.width), np.int32(camera.height), np.int32(columns), np.int32(lists.band.first * columns)),
        *(projected.splats, lists.entries, lists.slots, lists.tile_starts, image, image_gradient, slot_gradients),
        group=_GROUP if gpu else 1,
    )
    if order.visible:
        engine.run(
            engine.kernel("sum_slot_gradients", "layout", "gradients", **frame.layout),
            order.visible,
            *(np.uint32(order.visible), order.positions, lists.slot_ranges, slot_gradients),
            engine.buffer("splat_gradients", 0),
            group=64,
        )


def project_backward(
    engine: Engine, frame: Pass, camera: Camera, storage: Storage, channels: cl.Buffer, projected: Projected
) -> DeviceGradients:
    """Carry the splats' gradients back to the Gaussians' parameters (projection_backward.cl)."""
    attributes = frame.channel_attributes
    gradients = DeviceGradients(
        *(
            engine.buffer(f"{name}_gradients", _blocked_bytes(storage, n))
            for name, n in (("geometry", GEOMETRY_ATTRIBUTES), ("channel", attributes), ("centre", 2))
        )
    )
    if storage.count:
        sources = ("spherical_harmonics", "spherical_harmonics_backward", "projection", "projection_backward")
        engine.run(
            engine.kernel(
                "project_backward",
                *("vector", "layout", *sources),
                SH_DEGREE=frame.sh_degree,
                CHANNEL_ATTRIBUTES=attributes,
                **frame.layout,
            ),
            -(-storage.count // LANES[engine.style]),
            *(np.uint32(storage.count), np.int32(camera.width), np.int32(camera.height), engine.buffer("camera", 0)),
            *(storage.geometry, channels, projected.depth_keys, engine.buffer("splat_gradients", 0)),
            *(gradients.geometry, gradients.channels, gradients.centres),
        )
    return gradients


def by_row(engine: Engine, storage: Storage, gradients: cl.Buffer, attributes: int) -> NDArray[np.float32]:
    """Return blocked device gradients as an array [K,attributes] in row order."""
    blocks = -(-storage.count // BLOCK)
    found = np.empty((storage.count, attributes), np.float32)
    with engine.mapped(gradients, (max(blocks, 1), attributes, BLOCK), np.float32) as blocked:
        found[storage.order] = blocked.transpose(0, 2, 1).reshape(-1, attributes)[: storage.count]
    return found


def _blocked_bytes(storage: Storage, attributes: int) -> int:
    return 4 * attributes * BLOCK * max(-(-storage.count // BLOCK), 1)
