"""The backward pass: from the gradient of an image to the gradients of the Gaussians' parameters."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.constants import GEOMETRY_ATTRIBUTES, MOMENTS
from gspure.opencl.binning import TileLists
from gspure.opencl.blending import SUM_GROUP, Canvas, walk_tiles
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Frame
from gspure.opencl.projection import Projected
from gspure.opencl.storage import Storage, blocked_shape


@dataclass(frozen=True)
class DeviceGradients:
    """Gradients on the device, in storage order and blocks: geometry (11), channels, projected centre (2)."""

    geometry: cl.Buffer
    channels: cl.Buffer
    centres: cl.Buffer


def clear_splat_gradients(frame: Frame) -> cl.Buffer:
    """Return the gradients that the bands of a frame add up, all zero."""
    shape = blocked_shape(frame.storage.count, MOMENTS + frame.traversal.channels)
    buffer = frame.engine.buffers.splat_gradients.sized(*shape)
    frame.engine.clear(buffer, 4 * prod(shape))
    return buffer


def blend_band_backward(
    frame: Frame,
    projected: Projected,
    lists: TileLists,
    canvas: Canvas,
    image_gradient: cl.Buffer,
    splat_gradients: cl.Buffer,
) -> None:
    """Walk one band of tiles backward (blending_backward_*.cl) and add up each Gaussian's slots (gradients.cl)."""
    slot_gradients = frame.engine.buffers.slot_gradients.sized(lists.capacity, MOMENTS + frame.traversal.channels)
    program = frame.program("vector", "layout", "blending", f"blending_backward_{frame.engine.style}")
    gradients = (image_gradient, slot_gradients)
    walk_tiles(program, "blend_tiles_backward", frame, projected, lists, canvas.image, *gradients)
    order = lists.order
    arguments = (order.visible, order.positions, lists.slot_ranges, slot_gradients, splat_gradients)
    frame.program("layout", "gradients").launch("sum_slot_gradients", order.visible, *arguments, group=SUM_GROUP)


def project_backward(frame: Frame, projected: Projected, splat_gradients: cl.Buffer) -> DeviceGradients:
    """Carry the splats' gradients back to the Gaussians' parameters (projection_backward.cl)."""
    storage, traversal, buffers = frame.storage, frame.traversal, frame.engine.buffers
    gradients = DeviceGradients(
        buffers.geometry_gradients.sized(*blocked_shape(storage.count, GEOMETRY_ATTRIBUTES)),
        buffers.channel_gradients.sized(*blocked_shape(storage.count, traversal.channel_attributes)),
        buffers.centre_gradients.sized(*blocked_shape(storage.count, 2)),
    )
    program = frame.program(
        *("vector", "layout", "spherical_harmonics", "spherical_harmonics_backward"),
        *("projection", "projection_backward"),
        SH_DEGREE=traversal.sh_degree,
        CHANNEL_ATTRIBUTES=traversal.channel_attributes,
    )
    program.launch(
        "project_backward",
        frame.engine.vectors(storage.count),
        *(storage.count, *frame.size, projected.camera, storage.geometry, frame.channels, projected.depth_keys),
        *(splat_gradients, gradients.geometry, gradients.channels, gradients.centres),
    )
    return gradients


def by_row(engine: Engine, storage: Storage, blocks: cl.Buffer, attributes: int) -> NDArray[np.float32]:
    """Return values that lie in storage order and blocks as an array [K,attributes] in row order."""
    rows = np.empty((storage.count, attributes), np.float32)
    with engine.mapped(blocks, blocked_shape(storage.count, attributes), np.float32) as blocked:
        rows[storage.order] = blocked.transpose(0, 2, 1).reshape(-1, attributes)[: storage.count]
    return rows
