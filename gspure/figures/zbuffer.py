"""Drawing of dots with numpy, for machines without OpenGL."""

from typing import Final

import numpy as np

from gspure.cameras.camera import Camera
from gspure.dtypes import Float32, UInt8
from gspure.figures.clouds import Cloud
from gspure.figures.viewpoint import project

_PIXELS_AT_ONCE: Final = 4_000_000


def draw(cloud: Cloud, camera: Camera, size: int) -> tuple[UInt8, Float32]:
    """Draw a cloud as dots with a diameter of `size` pixels on white; the nearest dot is visible.

    All points are in view (see `gspure.figures.viewpoint.in_view`). Return colour [H,W,3], and depth [H,W] along the
    view, inf in the background.
    """
    pixels, depth = project(cloud.points, camera)
    shape = (camera.height + 2 * size, camera.width + 2 * size)  # dots may cross the border
    image = np.full((*shape, 3), 255, np.uint8)
    nearest = np.full(shape, np.inf, np.float32)
    grid = np.indices((size, size)).reshape(2, -1).T
    dot = grid[((grid - (size - 1) / 2) ** 2).sum(axis=1) <= size**2 / 4]
    far_to_near = np.argsort(-depth, kind="stable")
    for rows in np.array_split(far_to_near, len(depth) * len(dot) // _PIXELS_AT_ONCE + 1):
        corner = np.rint(pixels[rows, ::-1] - size / 2).astype(np.intp) + size
        y, x = (corner[:, None] + dot).reshape(-1, 2).T
        image[y, x] = np.repeat(cloud.colours[rows], len(dot), axis=0)  # the last write is kept
        nearest[y, x] = np.repeat(depth[rows], len(dot))
    inner = slice(size, -size)
    return image[inner, inner], nearest[inner, inner]
