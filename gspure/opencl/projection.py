"""Projection of a model into one view (projection.cl)."""

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from gspure.arrays import Float32, Int32
from gspure.cameras.camera import Camera
from gspure.constants import FOOTPRINT_FLOATS, NEAR_CENTRE
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.storage import Storage


@dataclass(frozen=True)
class Projected:
    """The projected Gaussians on the device, in storage order, and the numbers of their `camera` (`camera_numbers`).

    The depth key of an invisible Gaussian is NOT_VISIBLE (layout.cl).
    """

    camera: cl.Buffer
    splats: cl.Buffer
    footprints: cl.Buffer
    areas: cl.Buffer
    depth_keys: cl.Buffer


def project(frame: Frame) -> Projected:
    """Project all Gaussians of a frame."""
    storage = frame.storage
    traversal = frame.traversal
    buffers = frame.engine.buffers
    projected = Projected(
        buffers.camera.holding(camera_numbers(frame.camera)),
        buffers.splats.sized(storage.count, traversal.splat_floats),
        buffers.footprints.sized(storage.count, FOOTPRINT_FLOATS),
        buffers.areas.sized(storage.count),
        buffers.depth_keys.sized(storage.count),
    )
    program = frame.program(
        "vector",
        "layout",
        "spherical_harmonics",
        "projection",
        SH_DEGREE=traversal.sh_degree,
        CHANNEL_ATTRIBUTES=traversal.channel_attributes,
    )
    program.launch(
        "project",
        frame.engine.vectors(storage.count),
        storage.count,
        *frame.size,
        projected.camera,
        storage.geometry,
        frame.channels or storage.geometry,
        projected.splats,
        projected.footprints,
        projected.areas,
        projected.depth_keys,
    )
    return projected


def splat_radii(engine: Engine, storage: Storage, camera: Camera, *, per_axis: bool = False) -> Int32:
    """Return the radii of splats by row, in pixels: [K] as 3DGS has them or, `per_axis`, [K,2] as gsplat has them."""
    radii = np.empty((storage.count, 2) if per_axis else storage.count, np.int32)
    frame = Frame(engine, storage, camera, Traversal("ewa"))
    program = frame.program("vector", "layout", "projection", "radii", SH_DEGREE=-1, CHANNEL_ATTRIBUTES=0)
    numbers = engine.buffers.camera.holding(camera_numbers(camera))
    with engine.writing(radii) as out:
        items = engine.vectors(storage.count)
        arguments = (storage.count, *frame.size, numbers, storage.geometry, storage.rows, out)
        program.launch("splat_extents" if per_axis else "splat_radii", items, *arguments)
    return radii


def camera_numbers(camera: Camera) -> Float32:
    """Return the numbers [24] of a camera for kernels (layout.cl): its own, its centre, and the origin of both.

    The origin is that of the world or, if the camera is far from it, the camera's centre. Otherwise, at coordinates of
    geographic size, 10^5 or more, view coordinates would have no correct digits in float32.
    """
    numbers = camera.numbers
    centre = camera.centre
    origin = np.zeros(3) if np.abs(centre).max() <= NEAR_CENTRE else centre.astype(np.float32).astype(np.float64)
    view = numbers[6:].reshape(3, 4)
    view[:, 3] += view[:, :3] @ origin
    return np.concatenate([numbers, centre - origin, origin]).astype(np.float32)
