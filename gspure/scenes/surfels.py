"""Flat Gaussians that tile a lit scene's surfaces: large where a surface is plain, small at edges and in patterns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.files import Float64, Indices
from gspure.scenes.lighting import LitScene
from gspure.scenes.solids import Box, Solid

SPREAD = 0.57  # standard deviation of a surfel along each side of its tile, in lengths of that side
THICKNESS = 0.002  # standard deviation across the surface, metres

_PLAIN, _BORDER, _CURVED = 0.002, 0.04, 0.1
"""What a tile's error counts beside how much colours differ within its surfel: a constant, the share of the surfel that
sticks out of its face, and how much normals differ. Chosen for the PSNR of renderings against photographs."""

_REACH = (np.arange(8) + 0.5) / 4 - 0.5
"""A surfel is looked at in these places along each side of its tile: half a side beyond either end."""

# low corner and size in unit coordinates, sides in metres
_TILE = np.dtype(
    {
        "names": ["solid", "face", "low", "size", "sides", "colour", "error"],
        "formats": [np.intp, np.intp, ("f8", 2), ("f8", 2), ("f8", 2), ("f8", 3), "f8"],
    }
)


@dataclass(frozen=True, eq=False)
class Surfels:
    """N flat Gaussians: centres [N,3] in metres, and display colours [N,3] in 0..1.

    The rows of a frame [N,3,3] are its principal axes, unit and right-handed: the two sides of the tile, and one across
    the surface. `scales` [N,3] are the standard deviations along them, in metres.
    """

    means: Float64
    frames: Float64
    scales: Float64
    colours: Float64

    def __len__(self) -> int:
        return len(self.means)

    def __getitem__(self, rows: Indices) -> Surfels:
        return Surfels(*(getattr(self, field.name)[rows] for field in fields(self)))

    def moved(self, transform: Float64) -> Surfels:
        """Return the surfels after a rigid `transform` [4,4]."""
        rotation, translation = transform[:3, :3], transform[:3, 3]
        return replace(self, means=self.means @ rotation.T + translation, frames=self.frames @ rotation.T)

    @staticmethod
    def joined(*parts: Surfels) -> Surfels:
        """Return all parts, one after the other."""
        return Surfels(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Surfels)))


def tile(lit: LitScene, count: int, rng: np.random.Generator) -> Surfels:
    """Tile all faces with `count` surfels, also those faces that no camera sees.

    From one tile per face on, the tiles with the largest errors are halved, across the side that leaves less error.
    """
    faces = [(index, face) for index, solid in enumerate(lit.scene.solids) for face in solid.faces]
    tiles = np.zeros(len(faces), _TILE)
    tiles["solid"], tiles["face"] = np.array(faces).T
    tiles["size"] = 1.0
    tiles = _measured(lit, tiles)
    while len(tiles) < count:
        order = np.argsort(-tiles["error"], kind="stable")
        worst, fine = np.split(tiles[order], [min(count - len(tiles), (len(tiles) + 3) // 4)])
        tiles = np.concatenate([fine, *_halved(lit, worst, rng)])
    return _surfels(lit, tiles[np.argsort(-tiles["error"], kind="stable")[:count]], rng)


def _halved(lit: LitScene, tiles: NDArray[Any], rng: np.random.Generator) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return both parts of each tile, cut near the middle."""
    cut = tiles["size"] * rng.uniform(0.4, 0.6, len(tiles))[:, None]
    across_u, across_v = (_cut(lit, tiles, cut[:, axis], axis) for axis in (0, 1))
    # where it matters little the longer side is cut: slender surfels leave gaps between them
    slenderness = np.sqrt(tiles["sides"][:, 0] / tiles["sides"][:, 1])
    better = across_u["error"].sum(axis=0) <= across_v["error"].sum(axis=0) * slenderness
    first, second = np.where(better, across_u, across_v)
    return first, second


def _cut(lit: LitScene, tiles: NDArray[Any], cut: Float64, axis: int) -> NDArray[Any]:
    """Return both parts [2,N] of tiles that are cut across `axis` at `cut` from their low corners."""
    first, second = tiles.copy(), tiles.copy()
    first["size"][:, axis] = cut
    second["size"][:, axis] -= cut
    second["low"][:, axis] += cut
    return _measured(lit, np.concatenate([first, second])).reshape(2, -1)


def _measured(lit: LitScene, tiles: NDArray[Any]) -> NDArray[Any]:
    """Fill in the tiles' sides, colours and errors."""
    places = np.stack(np.meshgrid(_REACH, _REACH), axis=-1).reshape(-1, 2)
    within = np.flatnonzero(((places > 0.0) & (places < 1.0)).all(axis=1))
    footprint = np.exp(-0.5 * (((places - 0.5) / SPREAD) ** 2).sum(axis=1))
    footprint /= footprint.sum()
    for index, face, rows in _by_face(tiles):
        solid = lit.scene.solids[index]
        low, size = tiles["low"][rows], tiles["size"][rows]
        uv = low[:, None] + places * size[:, None]
        out = ((uv < 0.0) | (uv > 1.0)).any(axis=2) & isinstance(solid, Box)
        flat = np.clip(uv, 0.0, 1.0).reshape(-1, 2)
        colours = lit.colours(index, np.full(len(flat), face), flat).reshape(*uv.shape[:2], 3)
        normals = solid.chart(face, flat)[1].reshape(*uv.shape[:2], 3)
        colour, off_colour = _spread(colours, within)
        _, bent = _spread(normals, within)
        sides = np.sqrt((_tangents(solid, face, low + 0.5 * size) ** 2).sum(axis=2)) * size
        differ = ((off_colour + _BORDER * out + _CURVED * bent) * footprint).sum(axis=1)
        tiles["sides"][rows], tiles["colour"][rows] = sides, colour
        tiles["error"][rows] = (_PLAIN + differ) * sides.prod(axis=1) * solid.detail
    return tiles


def _by_face(tiles: NDArray[Any]) -> Iterator[tuple[int, int, Indices]]:
    """Yield solid, face and rows of the tiles of each face."""
    for index, face in np.unique(tiles[["solid", "face"]]):
        yield index, face, np.flatnonzero((tiles["solid"] == index) & (tiles["face"] == face))


def _spread(values: Float64, within: Indices) -> tuple[Float64, Float64]:
    """Return the means [N,3] of vectors [N,S,3] within tiles, and the squared differences [N,S] of all from them."""
    mean = values[:, within].mean(axis=1)
    return mean, ((values - mean[:, None]) ** 2).sum(axis=2)


def _tangents(solid: Solid, face: int, uv: Float64) -> Float64:
    """Return the derivatives [N,2,3] of a face's chart along u and v, metres."""
    steps = 1e-4 * np.eye(2)
    pairs = [(solid.chart(face, uv + step)[0], solid.chart(face, uv - step)[0]) for step in steps]
    return np.stack([(after - before) / 2e-4 for after, before in pairs], axis=1)


def _surfels(lit: LitScene, tiles: NDArray[Any], rng: np.random.Generator) -> Surfels:
    """Return one surfel for each tile, near its middle."""
    means, frames = np.empty((len(tiles), 3)), np.empty((len(tiles), 3, 3))
    for index, face, rows in _by_face(tiles):
        solid = lit.scene.solids[index]
        middles = tiles["low"][rows] + rng.uniform(0.45, 0.55, (len(rows), 2)) * tiles["size"][rows]
        means[rows], _ = solid.chart(face, middles)
        tangents = _tangents(solid, face, middles)
        frames[rows, :2] = tangents / np.sqrt((tangents**2).sum(axis=2, keepdims=True))
    frames[:, 2] = np.cross(frames[:, 0], frames[:, 1])
    scales = np.concatenate([SPREAD * tiles["sides"], np.full((len(tiles), 1), THICKNESS)], axis=1)
    return Surfels(means, frames, scales, tiles["colour"].copy())
