"""A picture of a point cloud with eye-dome lighting, drawn by pyvista, or by numpy without OpenGL.

Both draw the same dots on white; those of pyvista are shaded as spheres.
"""

from typing import Any, Final

import numpy as np

from gspure.cameras.camera import Camera
from gspure.figures.clouds import Cloud
from gspure.figures.probe import prefer_egl
from gspure.figures.viewpoint import in_view, project
from gspure.files import Float32, UInt8

_SMOOTHING: Final = 2  # factor of supersampling
_PIXELS_AT_ONCE: Final = 4_000_000

_STRENGTH: Final = 30.0
_DARKEST: Final = 0.4
_DIRECTIONS: Final = 8


def portrait(cloud: Cloud, camera: Camera, *, opengl: bool) -> UInt8:
    """Return a picture of a cloud, uint8 [H,W,3] on white.

    The size is that of `camera`, which has square pixels (see `gspure.figures.viewpoint.fitted`). With `opengl`,
    pyvista draws, which ends the process if OpenGL does not work (see `gspure.figures.probe.gl_problem`).
    """
    cloud = cloud.subset(in_view(cloud.points, camera))
    if len(cloud) == 0:
        return np.full((camera.height, camera.width, 3), 255, np.uint8)
    fine = camera.resized(camera.width * _SMOOTHING, camera.height * _SMOOTHING)
    size = dot_size(len(cloud), fine)
    image, depth = (_draw_balls if opengl else draw_dots)(cloud, fine, size)
    image = eye_dome(image, depth, radius=max(size, fine.width // 200))
    blocks = image.reshape(camera.height, _SMOOTHING, camera.width, _SMOOTHING, 3)
    smooth: UInt8 = np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8)
    return smooth


def dot_size(count: int, camera: Camera) -> int:
    """Return the diameter in pixels at which `count` evenly spread dots cover the image."""
    return max(int(min(2 * np.sqrt(camera.width * camera.height / count), camera.width / 150)), 2)


def draw_dots(cloud: Cloud, camera: Camera, size: int) -> tuple[UInt8, Float32]:
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


def _draw_balls(cloud: Cloud, camera: Camera, size: int) -> tuple[UInt8, Float32]:
    """Draw like `draw_dots`, with pyvista."""
    prefer_egl()
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=(camera.width, camera.height), lighting="light kit")
    try:
        plotter.set_background("white")
        plotter.disable_anti_aliasing()  # `portrait` supersamples
        plotter.add_mesh(
            pv.PolyData(cloud.points.astype(np.float32)),
            scalars=cloud.colours,
            rgb=True,
            style="points",
            point_size=size,
            render_points_as_spheres=True,
            ambient=0.3,
            diffuse=0.75,
        )
        _aim(plotter.camera, camera)
        depth = project(cloud.points, camera)[1]
        plotter.camera.clipping_range = (depth.min() * 0.99, depth.max() * 1.01)
        plotter.show(auto_close=False)
        image: UInt8 = plotter.screenshot(return_img=True)
        nearest = -plotter.get_image_depth(fill_value=-np.inf).astype(np.float32)
    finally:
        plotter.close()
    return image, nearest


def _aim(vtk_camera: Any, camera: Camera) -> None:
    """Set pose and intrinsics of VTK's camera."""
    _, down, forward = camera.viewmat[:3, :3]
    vtk_camera.position = camera.centre
    vtk_camera.focal_point = camera.centre + forward
    vtk_camera.up = -down
    vtk_camera.view_angle = np.degrees(2 * np.arctan(camera.height / (2 * camera.K[1, 1])))
    offset = 2 * camera.K[:2, 2] / (camera.width, camera.height) - 1
    vtk_camera.SetWindowCenter(-offset[0], offset[1])


def eye_dome(image: UInt8, depth: Float32, radius: int) -> UInt8:
    """Return the image with eye-dome lighting: a pixel is darker, the nearer its neighbours are (Boucheny 2009).

    It shows edges and depth of point clouds, which have no normals. VTK's filter has a fixed strength, at which the
    outlines of small dots hide their colours.

    Neighbours are `radius` pixels away. `depth` [H,W] is the distance along the view; inf in the background, which is
    left unchanged.
    """
    octaves = np.log2(depth)
    height, width = depth.shape
    padded = np.pad(octaves, radius, constant_values=np.inf)
    occlusion = np.zeros_like(depth)
    for angle in np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS):
        y, x = radius + np.rint(radius * np.array([np.sin(angle), np.cos(angle)])).astype(int)
        with np.errstate(invalid="ignore"):  # inf - inf beside the cloud
            occlusion += np.fmax(octaves - padded[y : y + height, x : x + width], 0)
    shade = _DARKEST + (1 - _DARKEST) * np.exp(-_STRENGTH / _DIRECTIONS * occlusion)
    shade[np.isinf(depth)] = 1
    shaded: UInt8 = np.rint(image * shade[..., None]).astype(np.uint8)
    return shaded
