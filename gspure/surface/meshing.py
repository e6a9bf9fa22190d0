"""The level set of the opacity field as a mesh (Yu et al. 2024, Gaussian Opacity Fields), without any retraining."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.cameras import Camera
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.model.mesh import Mesh
from gspure.opencl.device import Device
from gspure.progress import say, track
from gspure.renderer import Renderer
from gspure.surface.field import LEVEL, opacity_field
from gspure.surface.marching import march
from gspure.surface.tetrahedra import box_points, shown, tetrahedra

OPAQUE: Final = 0.1
"""Least opacity of the Gaussians that tetrahedra are made of (an option of GOF's); the field is that of all."""

HALVINGS: Final = 8
"""Steps of bisection along each edge that the surface crosses (GOF)."""


def opaque(model: Gaussians) -> NDArray[np.bool_]:
    """Return which Gaussians [K] tetrahedra are made of."""
    return np.asarray(model.opacities > OPAQUE)


def extract_mesh(model: Gaussians, cameras: Sequence[Camera], device: Device | None = None) -> Mesh:
    """Return the surface O(x) = 1/2 of what the `cameras` see.

    Parameters
    ----------
    model : Gaussians
        With its 3-D filter applied (`gspure.surface.filter.filtered`).
    cameras : sequence of Camera
    device : Device, optional

    Raises
    ------
    InputError
        If the views show too little for a tetrahedron, or nothing that is half opaque.

    """
    points = box_points(model.subset(opaque(model)))
    points = points[shown(points, cameras)]
    if len(points) < 4:  # the corners of one tetrahedron
        expected = f"Gaussians of an opacity above {OPAQUE} in the views"
        raise InputError("model", "surface", expected=expected, found=f"{len(points)} points around such")
    say(f"tetrahedra between {len(points)} points")
    cells = tetrahedra(points)
    renderer = Renderer(model, device, energy="ray")
    inside = opacity_field(renderer, track(cameras, "opacity field"), points, outside=LEVEL) >= LEVEL
    edges, faces = march(points, cells, inside)
    if not len(faces):
        raise InputError("model", "surface", expected=f"an opacity of {LEVEL} somewhere", found="none in any view")
    within, without = points[edges].transpose(1, 0, 2)
    for _ in track(range(HALVINGS), "bisection"):
        middle = (within + without) / 2
        inside = (opacity_field(renderer, cameras, middle, outside=LEVEL) >= LEVEL)[:, None]
        within, without = np.where(inside, middle, within), np.where(inside, without, middle)
    return Mesh((within + without) / 2, faces)
