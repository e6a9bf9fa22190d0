"""Pictures of point clouds, drawn by pyvista with eye-dome lighting, side by side above their legends."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from gspure.arrays import Float32, Float64, UInt8
from gspure.cameras.camera import Camera
from gspure.figures import style
from gspure.figures.clouds import Colouring
from gspure.figures.viewpoint import in_view, project
from gspure.images import levels, read_image

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURE_WIDTH: Final = round(style.COLUMN * style.DPI)  # width in pixels of a picture in a column, without resampling
PAGE_WIDTH: Final = round(style.PAGE * style.DPI)  # width in pixels of all pictures across the page

_ROW: Final = 0.15  # height of a row of the legend, inches
_TITLE: Final = 0.2  # height of a title
_NAME: Final = 0.2  # width of the name beside a plate
_SMOOTHING: Final = 2  # factor of supersampling
_STRENGTH: Final = 30.0  # of eye-dome lighting
_DARKEST: Final = 0.4  # least factor of eye-dome lighting
_LIGHT: Final = (-0.3, 0.6, 1.0)  # from the cloud to its light: left, up and to the camera
_DIRECTIONS: Final = 8  # of the neighbours in eye-dome lighting


if sys.platform == "linux":  # by default, VTK needs an X server, even off screen
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")


def opengl_works() -> bool:
    """Return whether VTK can draw off screen: from version 9.4 on, it makes windows of EGL only if EGL works."""
    return _egl_window() is not None or opengl_renderer() is not None


def opengl_renderer() -> str | None:
    """Return the name of OpenGL's renderer; None if it does not work."""
    import pyvista as pv

    window = _egl_window()
    if window is not None:
        window.Initialize()
        return str(re.findall("OpenGL renderer string: *(.*)", window.ReportCapabilities())[0])
    try:
        return str(pv.GPUInfo().renderer)  # by another process, which VTK may end
    except RuntimeError:
        return None


def _egl_window() -> Any | None:
    import pyvista as pv
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - registers the windows
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    with pv.vtk_verbosity("off"):
        window = vtkRenderWindow()
    return window if window.GetClassName() == "vtkEGLRenderWindow" and pv.vtk_version_info >= (9, 4) else None


def portraits(points: Float32, colourings: Sequence[UInt8], camera: Camera) -> list[UInt8]:
    """Return pictures of points [N,3] in each of several colourings, uint8 [N,3]: uint8 [H,W,3] on white.

    The size is that of `camera`, which has square pixels (see `gspure.figures.viewpoint.fitted`). VTK ends the process
    if OpenGL does not work (see `opengl_works`).
    """
    rows = in_view(points, camera)
    if len(rows) == 0:
        return [np.full((camera.height, camera.width, 3), 255, np.uint8) for _ in colourings]
    fine = camera.resized(camera.width * _SMOOTHING, camera.height * _SMOOTHING)
    spread = 2 * np.sqrt(fine.width * fine.height / len(rows))  # of points that cover the picture evenly
    size = max(int(min(spread, fine.width / 150)), 2)
    images, depth = _draw_balls(points[rows], [colours[rows] for colours in colourings], fine, size)
    shade = eye_dome(depth, radius=max(size, fine.width // 200))[..., None] / np.float32(_SMOOTHING**2)
    subpixels = [np.s_[y::_SMOOTHING, x::_SMOOTHING] for y in range(_SMOOTHING) for x in range(_SMOOTHING)]
    return [np.rint(sum(image[each] * shade[each] for each in subpixels)).astype(np.uint8) for image in images]


def _draw_balls(points: Float32, colourings: Sequence[UInt8], camera: Camera, size: int) -> tuple[list[UInt8], Float32]:
    """Draw points in view as balls with a diameter of `size` pixels on white.

    Return a picture [H,W,3] for each colouring, and depth [H,W] along the view, inf in the background.
    """
    import pyvista as pv
    from vtkmodules.vtkCommonCore import vtkFloatArray, vtkUnsignedCharArray

    corners = (0, 0, camera.width - 1, camera.height - 1)
    shape = (camera.height, camera.width)
    images: list[UInt8] = []
    with closing(pv.Plotter(off_screen=True, window_size=shape[::-1], lighting="none")) as plotter:
        plotter.set_background("white")
        plotter.disable_anti_aliasing()  # `portraits` supersamples
        plotter.add_light(pv.Light(position=_LIGHT, light_type="camera light"))  # a kit of five takes twice as long
        cloud = pv.PolyData(points.astype(np.float32))
        cloud["colours"] = colourings[0]
        look = {"style": "points", "point_size": size, "render_points_as_spheres": True}
        plotter.add_mesh(cloud, scalars="colours", rgb=True, ambient=0.45, diffuse=0.6, **look)
        _aim(plotter.camera, camera)
        depth = project(points, camera)[1]
        near = depth.min() * 0.99
        far = depth.max() * 1.01
        plotter.camera.clipping_range = (near, far)
        # Screenshots of pyvista draw again, and its depth takes longer than the drawing: read what the window holds.
        for colours in colourings:
            cloud["colours"] = colours
            plotter.render_window.Render()
            pixels = vtkUnsignedCharArray()
            plotter.render_window.GetPixelData(*corners, 0, pixels, 0)
            images.append(pv.convert_array(pixels).reshape(*shape, 3)[::-1])
        z_buffer = vtkFloatArray()
        plotter.render_window.GetZbufferData(*corners, z_buffer)
        z = pv.convert_array(z_buffer).reshape(shape)[::-1]
    distance = near * far / (far - z.astype(np.float64) * (far - near))
    return images, np.where(z < 1, distance, np.inf).astype(np.float32)


def _aim(vtk_camera: Any, camera: Camera) -> None:
    """Set pose and intrinsics of VTK's camera."""
    _, down, forward = camera.viewmat[:3, :3]
    vtk_camera.position = camera.centre
    vtk_camera.focal_point = camera.centre + forward
    vtk_camera.up = -down
    vtk_camera.view_angle = np.degrees(2 * np.arctan(camera.height / (2 * camera.K[1, 1])))
    offset = 2 * camera.K[:2, 2] / (camera.width, camera.height) - 1
    vtk_camera.SetWindowCenter(-offset[0], offset[1])


def eye_dome(depth: Float32, radius: int) -> Float32:
    """Return the factors [H,W] of eye-dome lighting: nearer neighbours darken a pixel (Boucheny 2009).

    Neighbours are `radius` pixels away. `depth` [H,W] is the distance along the view; inf in the background, where the
    factor is 1. VTK's filter has a fixed strength, at which the outlines of small dots hide their colours.
    """
    octaves = np.log2(depth)
    height, width = depth.shape
    padded = np.pad(octaves, radius, constant_values=np.inf)
    occlusion = np.zeros_like(depth)
    for angle in np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS):
        y, x = radius + np.rint(radius * np.array([np.sin(angle), np.cos(angle)])).astype(int)
        with np.errstate(invalid="ignore"):  # inf - inf beside the cloud
            occlusion += np.fmax(octaves - padded[y : y + height, x : x + width], 0)
    shade = np.asarray(_DARKEST + (1 - _DARKEST) * np.exp(-_STRENGTH / _DIRECTIONS * occlusion), np.float32)
    shade[np.isinf(depth)] = 1
    return shade


def write_plate(
    path: Path,
    pictures: Sequence[UInt8],
    keys: Sequence[Colouring],
    titles: Sequence[str] = (),
    names: Sequence[Mapping[str, Float64]] = (),
) -> None:
    """Write pictures of one size as a PNG, each with the legend or scale of its colours and an optional title.

    `names` holds, for each picture, names to write in it and their pixels.
    """
    from matplotlib.patheffects import withStroke

    height, width = pictures[0].shape[:2]
    count = len(pictures)
    above = _TITLE if titles else 0.0
    below = _ROW * (max(len(key.legend) or 2 for key in keys) + 0.7)
    total = above + height / style.DPI + below
    placed = [(i * width, round(above * style.DPI), picture) for i, picture in enumerate(pictures)]
    with style.page(path, count * width / style.DPI, total, layout=None, pictures=placed) as figure:
        for i, key in enumerate(keys):
            _draw_key(figure, key, (i / count, 1 / count), below / total, total)
        for i, named in enumerate(names):
            for name, (x, y) in named.items():
                left = (i + x / width) / count
                bottom = 1 - (above + y / style.DPI) / total
                outline = [withStroke(linewidth=1.6, foreground="white")]
                look: dict[str, Any] = {"fontsize": 7, "weight": "bold", "path_effects": outline}
                figure.text(left, bottom, name, ha="center", va="center", **look)
        for i, title in enumerate(titles):
            figure.text((i + 0.5) / count, 1 - 0.5 * above / total, title, ha="center", va="center")


def stack_plates(path: Path, plates: Mapping[str, Path]) -> None:
    """Write plates of `write_plate` one above the other, the titles above the first, with a name beside each."""
    inset = _NAME if len(plates) > 1 else 0.0
    title_rows = round(_TITLE * style.DPI)
    with_titles, *more = (levels(read_image(file)) for file in plates.values())
    pictures = [with_titles, *(picture[title_rows:] for picture in more)]
    tops = np.cumsum([0, *map(len, pictures)])
    placed = [(round(inset * style.DPI), int(top), picture) for top, picture in zip(tops, pictures, strict=False)]
    width = inset + style.PAGE
    total = tops[-1] / style.DPI
    with style.page(path, width, total, layout=None, pictures=placed) as figure:
        for name, middle in zip(plates, (tops[1:] + tops[:-1]) / 2 / tops[-1], strict=True):
            if inset:
                figure.text(inset / 2 / width, 1 - middle, name, rotation=90, ha="center", va="center")


def _draw_key(figure: Figure, key: Colouring, span: tuple[float, float], share: float, height: float) -> None:
    """Draw a legend or scale in the lower `share` of a figure of `height` inches; `span` is its (left edge, width)."""
    from matplotlib.lines import Line2D

    left, width = span
    for i, row in enumerate(key.legend):
        look: dict[str, Any] = {"marker": "o", "markersize": 4, "linewidth": 0}
        dots = [Line2D([], [], color=colour, label=label, **look) for label, colour in row]
        place = (left + width / 2, share * (len(key.legend) - i - 0.3) / len(key.legend))
        figure.legend(handles=dots, loc="center", bbox_to_anchor=place, ncols=len(row), borderpad=0, fontsize=5.7)
    if key.scale is not None:
        box = (left + 0.12 * width, share - 0.162 / height, 0.76 * width, 0.073 / height)
        axes = figure.add_axes(box, xticks=[], yticks=[], frame_on=False)
        axes.imshow(key.scale[None], aspect="auto")
        axes.set_xticks(np.linspace(0, len(key.scale) - 1, 3), key.scale_labels)
        axes.get_xticklabels()[0].set_horizontalalignment("left")
        axes.get_xticklabels()[-1].set_horizontalalignment("right")
        axes.tick_params(length=0, pad=2)
