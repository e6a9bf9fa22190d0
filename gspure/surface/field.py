"""The opacity field O(x) of a model and its views (Yu et al. 2024, Gaussian Opacity Fields)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.cameras import Camera
from gspure.renderer import Renderer

LEVEL: Final = 0.5
"""Opacity of the surface (GOF)."""

_CHUNK = 1 << 20
"""Points per evaluation."""


def opacity_field(
    renderer: Renderer, cameras: Iterable[Camera], points: NDArray[Any], *, outside: float = 0.0
) -> NDArray[np.float32]:
    """Return O [P], the minimum over the views of the opacity of the world `points` [P,3]; 1 if no view shows them.

    Parameters
    ----------
    renderer : Renderer
        Of the model, energy "ray".
    cameras : iterable of Camera
    points : array [P,3]
    outside : float
        Points below this are not evaluated in further views, so values below it are upper bounds.

    """
    field = np.ones(len(points), np.float32)
    for camera in cameras:
        inside = np.flatnonzero(field >= outside)
        for begin in range(0, len(inside), _CHUNK):
            rows = inside[begin : begin + _CHUNK]
            field[rows] = np.minimum(field[rows], renderer.opacities_at(camera, points[rows]))
    return field
