"""The backward pass: from the gradient of an image to the gradients of the Gaussians' parameters."""

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from gspure.arrays import Float32
from gspure.constants import GEOMETRY_ATTRIBUTES, MOMENTS
from gspure.opencl.binning import TileLists
from gspure.opencl.blending import SUM_GROUP, Canvas, walk_tiles
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Frame
from gspure.opencl.projection import Projected
from gspure.opencl.storage import Storage, blocked_shape

_NOT_VISIBLE = 0xFFFFFFFF  # layout.cl


@dataclass(frozen=True)
class DeviceGradients:
    """Gradients on the device, in storage order and blocks: geometry (11), channels, projected centre (2)."""

    geometry: cl.Buffer
    channels: cl.Buffer
    centres: cl.Buffer


def blend_band_backward(
    frame: Frame, projected: Projected, lists: TileLists, canvas: Canvas, image_gradient: cl.Buffer
) -> cl.Buffer:
    """Walk one band of tiles backward (blending_backward_*.cl) and add up each Gaussian's slots (gradients.cl).

    Return the gradients of the splats: sums over this band and the bands before it.
    """
    buffers = frame.engine.buffers
    gradients = MOMENTS + frame.traversal.channels
    slot_gradients = buffers.slot_gradients.sized(lists.capacity, gradients)
    program = frame.program("vector", "layout", "blending", f"blending_backward_{frame.engine.style}")
    images = (canvas.image, image_gradient)
    walk_tiles(program, "blend_tiles_backward", frame, projected, lists, *images, slot_gradients)
    splat_gradients = buffers.splat_gradients.sized(*blocked_shape(frame.storage.count, gradients))
    order = lists.order
    program = frame.program("layout", "gradients", FIRST_BAND=int(lists.band.start == 0))
    arguments = (order.visible, order.positions, lists.slot_ranges, slot_gradients, splat_gradients)
    program.launch("sum_slot_gradients", order.visible, *arguments, group=SUM_GROUP)
    return splat_gradients


def project_backward(frame: Frame, projected: Projected, splat_gradients: cl.Buffer) -> DeviceGradients:
    """Carry the splats' gradients back to the Gaussians' parameters (projection_backward.cl)."""
    storage = frame.storage
    traversal = frame.traversal
    buffers = frame.engine.buffers
    gradients = DeviceGradients(
        buffers.geometry_gradients.sized(*blocked_shape(storage.count, GEOMETRY_ATTRIBUTES)),
        buffers.channel_gradients.sized(*blocked_shape(storage.count, traversal.channel_attributes)),
        buffers.centre_gradients.sized(*blocked_shape(storage.count, 2)),
    )
    program = frame.program(
        "vector",
        "layout",
        "spherical_harmonics",
        "spherical_harmonics_backward",
        "projection",
        "projection_backward",
        SH_DEGREE=traversal.sh_degree,
        CHANNEL_ATTRIBUTES=traversal.channel_attributes,
    )
    program.launch(
        "project_backward",
        frame.engine.vectors(storage.count),
        storage.count,
        *frame.size,
        projected.camera,
        storage.geometry,
        frame.channels,
        projected.depth_keys,
        splat_gradients,
        gradients.geometry,
        gradients.channels,
        gradients.centres,
    )
    return gradients


def by_row(engine: Engine, storage: Storage, blocks: cl.Buffer, attributes: int, part: range | None = None) -> Float32:
    """Return `attributes`, or a `part` of them, in storage order and blocks as an array [K,n] in row order."""
    part = range(attributes) if part is None else part
    count = storage.count
    values = np.empty((count, len(part)), np.float32)
    with engine.writing(values) as out:
        blocked, *_ = blocked_shape(count, attributes)
        shape = (count, len(part), part.start, attributes)
        engine.program("rows").launch("by_row", blocked, *shape, blocks, storage.rows, out)
    return values


def covariance_gradients(frame: Frame, projected: Projected) -> Float32:
    """Return the gradients [K,3] of the covariances on the image plane, xx, xy and yy in square pixels, by row.

    They are those of 2 / log2(e) H^T N H (docs/gradients.md), twice its xy, and zero for Gaussians that are not drawn.
    They belong to the last backward pass.
    """
    engine = frame.engine
    storage = frame.storage
    traversal = frame.traversal
    attributes = MOMENTS + traversal.channels
    splat_gradients = engine.buffers.splat_gradients.sized(*blocked_shape(storage.count, attributes))
    moments = by_row(engine, storage, splat_gradients, attributes)
    splats = engine.read(projected.splats, (storage.count, traversal.splat_floats), np.float32)
    drawn = engine.read(projected.depth_keys, (storage.count,), np.uint32) != _NOT_VISIBLE
    rows = storage.order[drawn]
    a, b, c = splats[drawn, 2:5].T  # SPLAT_A, SPLAT_B, SPLAT_C
    aa, ab, bb = moments[rows, 3:6].T
    xx = a * a * aa
    xy = a * (b * aa + c * ab)
    yy = b * b * aa + 2 * b * c * ab + c * c * bb
    covariances = np.zeros((storage.count, 3), np.float32)
    covariances[rows] = 2 * np.log(2) * np.stack([xx, 2 * xy, yy], axis=1)
    return covariances
