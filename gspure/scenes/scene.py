"""A scene: solids, a lamp and the sky, and what a ray meets first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gspure.scenes.solids import Solid, Vector
from gspure.scenes.textures import GAMMA

Float64 = NDArray[np.float64]

_RAYS_AT_ONCE = 8192
"""Rays followed together: few enough for their arrays to stay in the cache."""


@dataclass(frozen=True)
class Lamp:
    """A horizontal square that shines downwards: its centre and edge length in metres, and its linear RGB radiance.

    The longer its edge, the softer its shadows.
    """

    centre: Vector
    side: float
    radiance: Vector


@dataclass(frozen=True, eq=False)
class Scene:
    """Solids under a lamp.

    Where a ray leaves the scene, `sky` is the linear radiance that comes from there and fills the shadows, and
    `background` the display colour of the pixel.
    """

    solids: tuple[Solid, ...]
    lamp: Lamp
    sky: Vector
    background: Vector = (0.0, 0.0, 0.0)


def first_hits(scene: Scene, origins: Float64, directions: Float64) -> tuple[Float64, NDArray[np.intp]]:
    """Return distances and numbers [N] of the solids that rays [N,3] meet first; inf and -1 if there is none."""
    distances = np.full(len(origins), np.inf)
    solids = np.full(len(origins), -1, np.intp)
    for start in range(0, len(origins), _RAYS_AT_ONCE):
        part = slice(start, start + _RAYS_AT_ONCE)
        for index, solid in enumerate(scene.solids):
            there = solid.distance(origins[part], directions[part])
            nearer = there < distances[part]
            solids[part][nearer] = index
            distances[part][nearer] = there[nearer]
    return distances, solids


def albedo(solid: Solid, faces: NDArray[np.intp], uv: Float64) -> Float64:
    """Return the linear reflectances [N,3] of places of a solid."""
    places = uv * solid.extents[faces]
    if len(solid.textures) == 1:
        return solid.textures[0](places)
    out = np.empty((len(uv), 3))
    for face, texture in enumerate(solid.textures):
        out[faces == face] = texture(places[faces == face])
    return out


def displayed(radiance: Float64) -> Float64:
    """Return display values in 0..1 of linear radiance, with a soft shoulder instead of clipping."""
    return (1.0 - np.exp(-radiance)) ** (1.0 / GAMMA)
