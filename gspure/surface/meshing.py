"""The opacity field O(x) of a model, and its level set as a mesh (Yu et al. 2024, Gaussian Opacity Fields)."""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.cameras import Camera
from gspure.dtypes import Bools, Float32
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.model.points import Mesh
from gspure.opencl.device import Device
from gspure.progress import say, track
from gspure.renderer import Renderer
from gspure.surface.tetrahedra import box_points, march, shown, tetrahedra

OPAQUE: Final = 0.1
"""Least opacity of the Gaussians that define tetrahedra (an option of GOF); all Gaussians define the field."""

HALVINGS: Final = 8
"""Steps of bisection along each edge that the surface crosses (GOF)."""

LEVEL: Final = 0.5
"""Opacity of the surface (GOF)."""

_CHUNK = 1 << 20
"""Points per evaluation."""


def opaque(model: Gaussians) -> Bools:
    """Return the mask [K] of the Gaussians that define tetrahedra."""
    return np.asarray(model.opacities > OPAQUE)


def extract_mesh(model: Gaussians, cameras: Sequence[Camera], device: Device | None = None) -> Mesh:
    """Return the surface O(x) = 1/2 in the views of `cameras`.

    The model has its 3-D filter applied (`gspure.surface.filter.filtered`). Raise `InputError` if the views show too
    few Gaussians for a tetrahedron, or none that is half opaque.
    """
    points = box_points(model[opaque(model)])
    points = points[shown(points, cameras)]
    if len(points) < 4:  # the corners of one tetrahedron
        expected = f"Gaussians of an opacity above {OPAQUE} in the views"
        raise InputError("model", "surface", expected=expected, found=f"{len(points)} points around them")
    say(f"tetrahedra between {len(points)} points")
    cells = tetrahedra(points)
    renderer = Renderer(model, device, energy="ray")
    inside = opacity_field(renderer, track(cameras, "opacity field"), points, outside=LEVEL) >= LEVEL
    edges, faces = march(points, cells, inside)
    if not len(faces):
        raise InputError("model", "surface", expected=f"an opacity of {LEVEL} somewhere", found="none in any view")
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
