"""The opacity field O(x) of a model and its views (Yu et al. 2024, Gaussian Opacity Fields)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.cameras import Camera
from gspure.renderer import Renderer

LEVEL: Final = 0.5
"""O of the surface (GOF)."""

_CHUNK = 1 << 20
"""Points that are placed in a view at a time."""


def opacity_field(
    renderer: Renderer, cameras: Iterable[Camera], points: NDArray[Any], *, outside: float = 0.0
) -> NDArray[np.float32]:
    """Return O [P], the least opacity of the world `points` [P,3] in any view; 1 where no view shows them.

    Parameters
    ----------
    renderer : Renderer
        Of the model, energy "ray".
    cameras : iterable of Camera
    points : array [P,3]
    outside : float
        Points found below this are not looked at again, so that what is below it is only an upper bound.

    """
    field = np.ones(len(points), np.float32)
    for camera in cameras:
        asked = np.flatnonzero(field >= outside)
        for begin in range(0, len(asked), _CHUNK):
            rows = asked[begin : begin + _CHUNK]
            field[rows] = np.minimum(field[rows], renderer.opacities_at(camera, points[rows]))
    return field
