"""The opacity field O(x) of a model, and its level set as a mesh (Yu et al. 2024, Gaussian Opacity Fields).

The 3-D filter of Mip-Splatting and GOF first limits Gaussians to the sampling rate of the views.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.cameras import Camera
from gspure.cameras.camera import points_shown
from gspure.errors import InputError
from gspure.files import Bools, Float32, Float64, Indices
from gspure.model import Gaussians
from gspure.model.filtered import widened
from gspure.model.gaussians import SCALES
from gspure.opencl.device import Device
from gspure.progress import say, track
from gspure.renderer import Renderer
from gspure.surface.tetrahedra import box_points, march, shown, tetrahedra

OPAQUE: Final = 0.1  # least one of the Gaussians that define tetrahedra (an option of GOF); all define the field
HALVINGS: Final = 8  # steps of bisection along each edge that the surface crosses (GOF)
LEVEL: Final = 0.5  # opacity of the surface (GOF)
FILTER_MARGIN: Final = 0.15  # extension of the image beyond its edges, as a share of its size (GOF)
FILTER_VARIANCE: Final = 0.2  # in squared pixels of the nearest view (Yu et al. 2024, Mip-Splatting)
_CHUNK = 1 << 20  # points per evaluation


@dataclass(frozen=True)
class Mesh:
    """Triangles: `vertices` [V,3] in world units, `faces` [F,3], anticlockwise as seen from outside."""

    vertices: Float64
    faces: Indices

    @property
    def corners(self) -> Float64:
        """Positions of the corners of each face, [F,3,3]."""
        return np.asarray(self.vertices[self.faces])


def filter_sizes(model: Gaussians, cameras: Sequence[Camera]) -> Float64:
    """Return the filter's standard deviation [K] in world units, by each Gaussian's nearest view.

    A Gaussian that no view shows gets the largest of all.

    Raise `InputError` if no view shows a Gaussian.
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

    GOF, which trains with the filter, also multiplies opacities by det s / det s' (`gspure.model.filtered`). Models
    trained with 3DGS's dilation, which keeps opacities, would become transparent where their Gaussians are flat.
    """
    scales = widened(model.log_scales, filter_sizes(model, cameras))
    return model.with_columns(dict(zip(SCALES, scales.T, strict=True)))


def opaque(model: Gaussians) -> Bools:
    """Return the mask [K] of the Gaussians that define tetrahedra."""
    return np.asarray(model.opacities > OPAQUE)


def extract_mesh(model: Gaussians, cameras: Sequence[Camera], device: Device | None = None) -> Mesh:
    """Return the surface O(x) = 1/2 in the views of `cameras`.

    The model has its 3-D filter applied (`smoothed`). Raise `InputError` if the views show too few Gaussians for a
    tetrahedron, or the opacity is below 1/2 at all of their points, or above it.
    """
    points = box_points(model[opaque(model)])
    points = points[shown(points, cameras)]
    if len(points) < 4:  # the corners of one tetrahedron
        expected = f"Gaussians of an opacity above {OPAQUE} in the views"
        raise InputError("model", "surface", expected=expected, found=f"{len(points)} points around them")
    say(f"building tetrahedra from {len(points)} points")
    cells = tetrahedra(points)
    renderer = Renderer(model, device, energy="ray")
    inside = opacity_field(renderer, track(cameras, "opacity field"), points, outside=LEVEL) >= LEVEL
    edges, faces = march(points, cells, inside)
    if not len(faces):
        found = f"only {'higher' if inside.any() else 'lower'} ones"
        raise InputError("model", "surface", expected=f"opacities on both sides of {LEVEL}", found=found)
    inner, outer = points[edges].transpose(1, 0, 2)
    for _ in track(range(HALVINGS), "bisection"):
        middle = (inner + outer) / 2
        inside = (opacity_field(renderer, cameras, middle, outside=LEVEL) >= LEVEL)[:, None]
        inner, outer = np.where(inside, middle, inner), np.where(inside, outer, middle)
    return Mesh((inner + outer) / 2, faces)


def opacity_field(
    renderer: Renderer, cameras: Iterable[Camera], points: NDArray[Any], *, outside: float = 0.0
) -> Float32:
    """Return O [P], the minimum over the views of the opacity of the world `points` [P,3]; 1 if no view shows them.

    The renderer has the energy "ray". Points below `outside` are not evaluated in further views, so values below it are
    upper bounds.
    """
    field = np.ones(len(points), np.float32)
    for camera in cameras:
        inside = np.flatnonzero(field >= outside)
        for begin in range(0, len(inside), _CHUNK):
            rows = inside[begin : begin + _CHUNK]
            field[rows] = np.minimum(field[rows], renderer.opacities_at(camera, points[rows]))
    return field
