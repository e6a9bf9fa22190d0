"""A scene: solids, a lamp and the sky, and what a ray meets first."""

from dataclasses import dataclass

import numpy as np

from gspure.files import Bools, Float64, Indices
from gspure.scenes.solids import GAMMA, Solid, Vector

_PACKET = 12  # successive rays that are tested together for solids out of their reach
_ROUNDING = 1e-6  # metres by which bounds are too large, so that rounding makes no solid seem out of reach
_PACKETS_AT_ONCE = 512  # packets followed together: few enough for their arrays to stay in the cache


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


def first_hits(scene: Scene, origins: Float64, directions: Float64) -> tuple[Float64, Indices]:
    """Return distances and numbers [N] of the solids that rays [N,3] meet first; inf and -1 if there is none."""
    count = len(origins)
    origins, directions = (
        np.pad(rays, ((0, -count % _PACKET), (0, 0)), mode="edge").reshape(-1, _PACKET, 3)
        for rays in (origins, directions)
    )
    distances = np.full(origins.shape[:2], np.inf)
    solids = np.full(origins.shape[:2], -1, np.intp)
    reached = _reached(scene, origins, directions)
    for index, solid in enumerate(scene.solids):
        packets = np.flatnonzero(reached[:, index])
        for start in range(0, len(packets), _PACKETS_AT_ONCE):
            part = packets[start : start + _PACKETS_AT_ONCE]
            there = solid.distance(origins[part].reshape(-1, 3), directions[part].reshape(-1, 3)).reshape(-1, _PACKET)
            before = distances[part]
            solids[part] = np.where(there < before, index, solids[part])
            distances[part] = np.minimum(there, before)
    return distances.ravel()[:count], solids.ravel()[:count]


def _reached(scene: Scene, origins: Float64, directions: Float64) -> Bools:
    """Return the solids [P,S] that packets of rays [P,K,3] may meet: their bounds meet a cone around the rays.

    The cone starts at the origin of one ray; bounds grow by the distance of the others' origins from it.
    """
    centres, radii = (np.array(part) for part in zip(*(solid.bound for solid in scene.solids), strict=True))
    apex, axis = origins[:, _PACKET // 2], directions[:, _PACKET // 2]
    axis = axis / np.sqrt(np.einsum("pi,pi->p", axis, axis))[:, None]
    lengths = np.sqrt(np.einsum("pki,pki->pk", directions, directions))
    cosine = (np.einsum("pki,pi->pk", directions, axis) / lengths).min(axis=1, keepdims=True) - _ROUNDING**2
    sine = np.sqrt(1.0 - np.minimum(cosine**2, 1.0))
    apart = origins - apex[:, None]
    reach = radii + np.sqrt(np.einsum("pki,pki->pk", apart, apart).max(axis=1, keepdims=True)) + _ROUNDING
    along = axis @ centres.T - np.einsum("pi,pi->p", apex, axis)[:, None]
    squared = (centres**2).sum(axis=1) + (apex**2).sum(axis=1, keepdims=True) - 2.0 * apex @ centres.T
    across = np.sqrt(np.maximum(squared - along**2, 0.0))
    beside, ahead = across * cosine - along * sine, along * cosine + across * sine  # of the cone's nearest side
    reached: Bools = (cosine < 0.0) | ((beside < reach) & (ahead > -reach))
    return reached


def albedo(solid: Solid, faces: Indices, uv: Float64) -> Float64:
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
