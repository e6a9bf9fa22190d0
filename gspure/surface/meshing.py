"""The opacity field O(x) of a model, and its level set as a mesh (Yu et al. 2024, Gaussian Opacity Fields).

The 3-D filter of Mip-Splatting and GOF first limits Gaussians to the sampling rate of the views.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gspure.arrays import Bools, Float64, Indices
from gspure.cameras import Camera
from gspure.cameras.camera import points_shown
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.model.finite import widened
from gspure.model.gaussians import SCALES
from gspure.opencl.device import Device
from gspure.opencl.opacity_field import PointRays
from gspure.progress import say, track
from gspure.renderer import Renderer
from gspure.surface.tetrahedra import box_points, march, shown, spaced, tetrahedra

OPAQUE: Final = 0.1  # least opacity of Gaussians that define tetrahedra (an option of GOF); all define the field
HALVINGS: Final = 6  # steps of bisection of an edge in each view that moves its vertex (GOF: 8, in all views)
LEVEL: Final = 0.5  # opacity of the surface (GOF)
FILTER_MARGIN: Final = 0.15  # extension of the image beyond its edges, as a share of its size (GOF)
FILTER_VARIANCE: Final = 0.2  # in squared pixels of the nearest view (Yu et al. 2024, Mip-Splatting)


@dataclass(frozen=True)
class Mesh:
    """Triangles: `vertices` [V,3] in world units, `faces` [F,3], anticlockwise as seen from outside."""

    vertices: Float64
    faces: Indices


def filter_sizes(model: Gaussians, cameras: Sequence[Camera]) -> Float64:
    """Return the filter's standard deviation [K] in world units, from each Gaussian's nearest view.

    A Gaussian that no view shows gets the largest of all. Raise `InputError` if no view shows a Gaussian.
    """
    nearest = np.full(len(model), np.inf)
    for camera in cameras:
        rows, positions = points_shown(camera, model.means, FILTER_MARGIN)
        nearest[rows] = np.minimum(nearest[rows], positions[:, 2])
    visible = np.isfinite(nearest)
    if not visible.any():
        raise InputError("cameras", "views", expected="a view of the model", found="no Gaussian in any view")
    focal = max(camera.K[0, 0] for camera in cameras)
    return np.asarray(np.sqrt(FILTER_VARIANCE) / focal * np.where(visible, nearest, nearest[visible].max()))


def smoothed(model: Gaussians, cameras: Sequence[Camera]) -> Gaussians:
    """Return the model with the filter of its views applied: scales s' = sqrt(s^2 + f^2), the same opacities.

    GOF trains with the filter and also multiplies opacities by det s / det s' (`gspure.model.finite`). Here, opacities
    stay: models trained with 3DGS's dilation would become transparent where their Gaussians are flat.
    """
    scales = widened(model.log_scales, filter_sizes(model, cameras))
    return model.with_columns(dict(zip(SCALES, scales.T, strict=True)))


def opaque(model: Gaussians) -> Bools:
    """Return the mask [K] of the Gaussians that define tetrahedra."""
    return np.asarray(model.opacities > OPAQUE)


def extract_mesh(model: Gaussians, cameras: Sequence[Camera], device: Device | None = None) -> Mesh:
    """Return the surface O(x) = 1/2 in the views of `cameras`.

    The model has its 3-D filter applied (`smoothed`). Raise `InputError` if the views show too few Gaussians for a
    tetrahedron, or the opacity is on the same side of 1/2 at all points.
    """
    boxed = model[opaque(model)]
    points = box_points(boxed)
    rows = np.flatnonzero(shown(points, cameras))
    sizes = boxed.scales.max(axis=1)[rows // 9]
    points = points[rows[spaced(points[rows], sizes)]]
    if len(points) < 4:  # the corners of one tetrahedron
        expected = f"Gaussians of an opacity above {OPAQUE} in the views"
        raise InputError("model", "surface", expected=expected, found=f"{len(points)} points around them")
    say(f"building tetrahedra from {len(points)} points")
    cells = tetrahedra(points)
    renderer = Renderer(model, device, energy="ray")
    first = first_outside(renderer, cameras, points)
    inside = first == len(cameras)
    edges, faces = march(points, cells, inside)
    if not len(faces):
        side = "higher" if inside.any() else "lower"
        raise InputError("model", "surface", expected=f"opacities on both sides of {LEVEL}", found=f"only {side} ones")
    return Mesh(crossings(renderer, cameras, points[edges], first[edges[:, 1]]), faces)


def first_outside(renderer: Renderer, cameras: Sequence[Camera], points: Float64) -> Indices:
    """Return the first view [P] in which each of the `points` [P,3] has O < 1/2; the number of views if none."""
    first = np.full(len(points), len(cameras))
    for i, camera in enumerate(track(cameras, "opacity field")):
        inside = np.flatnonzero(first == len(cameras))
        first[inside[_outside(renderer.rays(camera), points[inside])]] = i
    return first


def crossings(renderer: Renderer, cameras: Sequence[Camera], edges: Float64, first: Indices) -> Float64:
    """Return the crossings [E,3] of the surface and the `edges` [E,2,3], which lead from inside to outside.

    They are exact to 1/128 of the edges' lengths. `first` [E] is the first view that sees the outer end outside; the
    views before it see both ends inside and are left out.
    """
    start = edges[:, 0]
    inner = edges[:, 1].copy()  # the surface lies between inner and outer
    outer = edges[:, 1].copy()
    for i, camera in enumerate(track(cameras, "surface")):
        rays = renderer.rays(camera)
        rows = np.flatnonzero(first <= i)
        rows = rows[_outside(rays, inner[rows])]
        outer[rows] = inner[rows]
        inner[rows] = start[rows]
        for _ in range(HALVINGS):
            middle = (inner[rows] + outer[rows]) / 2
            outside = _outside(rays, middle)[:, None]
            inner[rows] = np.where(outside, inner[rows], middle)
            outer[rows] = np.where(outside, middle, outer[rows])
    return np.asarray((inner + outer) / 2)


def _outside(rays: PointRays, points: Float64) -> Bools:
    """Return the mask of the `points` [P,3] that a view sees outside."""
    return np.asarray(rays.opacities(points, least=1 - LEVEL) < LEVEL)
