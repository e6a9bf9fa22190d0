"""Scenes, where rays hit them first, and their diffuse light, baked once: a soft lamp, the sky, and one bounce.

Light is kept on a grid of nodes per face (a light map) and interpolated between them. All views read the same maps, so
they show the same colours, free of sampling noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gspure.arrays import Bools, Float64, Indices
from gspure.scenes.solids import Solid, Vector

Lightmap = Float64  # light on one solid [faces, n, n, 3] at n x n nodes of each face (v, u): irradiance / pi, linear
NODE_SPACING = 0.09  # metres between the nodes of a light map along a face's longer side
NODES = (6, 80)  # fewest and most nodes along a face
LAMP_SAMPLES = 8  # the lamp is sampled at the centres of this many by this many squares
DIRECTIONS = 64  # the bounce is gathered from this many directions, spread evenly by cosine along a golden-angle spiral
_CLEARANCE = 1e-4  # metres by which nodes stand off their surface
_ROUNDING = 1e-2  # metres by which bounding spheres are too large, so that float32 rounding loses no hit
_FAR = np.float32(1e6)  # metres, in place of infinity, which becomes NaN in matrix products
_RAYS_AT_ONCE = 1 << 13  # rays followed together: bounds the memory of `_in_reach`


@dataclass(frozen=True)
class Lamp:
    """A horizontal square that shines downwards; its centre and side are in metres, its radiance is linear RGB."""

    centre: Vector
    side: float
    radiance: Vector


@dataclass(frozen=True, eq=False)
class Scene:
    """Solids under a lamp; `sky` is the linear radiance that comes from where rays leave the scene."""

    solids: tuple[Solid, ...]
    lamp: Lamp
    sky: Vector


@dataclass(frozen=True, eq=False)
class LitScene:
    """A scene with its light maps, one per solid."""

    scene: Scene
    lightmaps: tuple[Lightmap, ...]

    def radiance(self, index: int, faces: Indices, uv: Float64) -> Float64:
        """Return the linear radiance [N,3] that leaves places of solid `index`."""
        solid = self.scene.solids[index]
        light = _interpolated(self.lightmaps[index], faces, uv)
        places = uv * solid.extents[faces]
        if len(solid.textures) == 1:
            return solid.textures[0](places) * light
        for face, texture in enumerate(solid.textures):
            light[faces == face] *= texture(places[faces == face])
        return light

    def traced(self, origins: Float64, directions: Float64) -> tuple[Float64, Float64]:
        """Return the linear radiance [N,3] that rays see (the sky's where they leave), and their distances [N]."""
        distances, solids = first_hits(self.scene, origins, directions)
        out = np.tile(np.asarray(self.scene.sky, np.float64), (len(origins), 1))
        for index, solid in enumerate(self.scene.solids):
            rows = np.flatnonzero(solids == index)
            points = origins[rows] + distances[rows, None] * directions[rows]
            out[rows] = self.radiance(index, *solid.locate(points))
        return out, distances


def first_hits(scene: Scene, origins: Float64, directions: Float64) -> tuple[Float64, Indices]:
    """Return distances and numbers [N] of the solids that rays [N,3] meet first; inf and -1 if there is none."""
    distances = np.full(len(origins), np.inf)
    solids = np.full(len(origins), -1, np.intp)
    for start in range(0, len(origins), _RAYS_AT_ONCE):
        part = slice(start, start + _RAYS_AT_ONCE)
        starts = np.ascontiguousarray(origins[part])
        gazes = directions[part]
        for index, in_reach in enumerate(_in_reach(scene, starts, gazes)):
            rows = np.flatnonzero(in_reach)
            hits = scene.solids[index].distance(starts.take(rows, axis=0), gazes.take(rows, axis=0))
            nearer = np.flatnonzero(hits < distances[part].take(rows))
            distances[part][rows[nearer]] = hits[nearer]
            solids[part][rows[nearer]] = index
    return distances, solids


def _in_reach(scene: Scene, origins: Float64, directions: Float64) -> Bools:
    """Return a mask [S,N], true where rays [N,3] meet the solids' bounding spheres, in float32."""
    bounds = [solid.bound for solid in scene.solids]
    centres = np.array([centre for centre, _ in bounds], np.float32)
    radii = np.array([radius for _, radius in bounds], np.float32)
    radii = np.minimum(radii + np.float32(_ROUNDING), _FAR)
    ones = np.ones(len(centres), np.float32)
    units = directions / np.sqrt(np.einsum("ni,ni->n", directions, directions))[:, None]
    rays = np.ones((5, len(units)), np.float32)
    rays[:3] = units.T
    rays[3] = np.einsum("ni,ni->n", origins, units)
    along = np.column_stack([centres, -ones]) @ rays[:4]
    rays[:3] = origins.T
    rays[3] = np.einsum("ni,ni->n", origins, origins)
    squared = np.column_stack([-2.0 * centres, ones, (centres**2).sum(axis=1) - radii**2]) @ rays
    return np.asarray((squared < along * along) & (along > -radii[:, None]))


def bake(scene: Scene, *, coarseness: int = 1) -> LitScene:
    """Return the scene with the light at its nodes: from the lamp, from the sky, and from other surfaces.

    Along each of two axes, nodes lie `coarseness` times as far apart, and the lamp's squares and the directions of the
    bounce are as many times as wide. So the cost falls with the fourth power.
    """
    spacing = NODE_SPACING * coarseness
    counts = [int(np.clip(np.ceil(solid.extents.max() / spacing) + 1, *NODES)) for solid in scene.solids]
    nodes = [_nodes(solid, n) for solid, n in zip(scene.solids, counts, strict=True)]
    points = np.concatenate([places for places, _ in nodes])
    normals = np.concatenate([directions for _, directions in nodes])
    direct = _from_lamp(scene, points, normals, LAMP_SAMPLES // coarseness)
    once = LitScene(scene, _maps(scene, direct, counts))
    bounced = _gathered(once, points, normals, DIRECTIONS // coarseness**2)
    return LitScene(scene, _maps(scene, direct + bounced, counts))


def _nodes(solid: Solid, n: int) -> tuple[Float64, Float64]:
    """Return points and normals [len(faces) * n * n, 3] of a solid's nodes, n along each side of a face."""
    line = np.clip(np.linspace(0.0, 1.0, n), 0.01 / n, 1.0 - 0.01 / n)
    uv = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    charts = [solid.chart(face, uv) for face in solid.faces]
    points = np.concatenate([places for places, _ in charts])
    normals = np.concatenate([directions for _, directions in charts])
    return points + _CLEARANCE * normals, normals


def _maps(scene: Scene, light: Float64, counts: Sequence[int]) -> tuple[Lightmap, ...]:
    """Return the light of all nodes as one map per solid; faces that do not exist stay dark."""
    maps = []
    ends = np.cumsum([len(solid.faces) * n * n for solid, n in zip(scene.solids, counts, strict=True)])
    for solid, n, part in zip(scene.solids, counts, np.split(light, ends[:-1]), strict=True):
        lightmap = np.zeros((len(solid.extents), n, n, 3))
        lightmap[list(solid.faces)] = part.reshape(-1, n, n, 3)
        maps.append(lightmap)
    return tuple(maps)


def _interpolated(lightmap: Lightmap, faces: Indices, uv: Float64) -> Float64:
    """Return the bilinear interpolation [N,3] of a light map."""
    n = lightmap.shape[1]
    place = uv * (n - 1)
    low = np.minimum(place.astype(np.intp), n - 2)
    u0, v0 = low.T
    fu, fv = (place - low).T[..., None]
    nodes = lightmap.reshape(-1, 3)
    first = (faces * n + v0) * n + u0

    def along_u(left: Indices) -> Float64:
        return np.asarray((1 - fu) * nodes.take(left, axis=0) + fu * nodes.take(left + 1, axis=0))

    return np.asarray((1 - fv) * along_u(first) + fv * along_u(first + n))


def _from_lamp(scene: Scene, points: Float64, normals: Float64, squares: int) -> Float64:
    """Return irradiance / pi [N,3] from the lamp: the mean of cos cos / distance^2 over its squares in sight."""
    lamp = scene.lamp
    total = np.zeros(len(points))
    line = ((np.arange(squares) + 0.5) / squares - 0.5) * lamp.side
    for y in line:
        for x in line:
            to_lamp = np.array(lamp.centre) + np.array([x, y, 0.0]) - points
            squared = np.einsum("ij,ij->i", to_lamp, to_lamp)
            # both cosines carry 1 / distance; the lamp faces straight down
            form = np.einsum("ij,ij->i", normals, to_lamp) * to_lamp[:, 2] / squared**2
            rows = np.flatnonzero((form > 0.0) & (to_lamp[:, 2] > 0.0))
            lit = rows[first_hits(scene, points[rows], to_lamp[rows])[0] >= 1.0]
            total[lit] += form[lit]
    return np.multiply.outer(total * lamp.side**2 / (np.pi * squares**2), lamp.radiance)


def _gathered(lit: LitScene, points: Float64, normals: Float64, directions: int) -> Float64:
    """Return the mean radiance [N,3] seen from points over cosine-distributed directions about their normals."""
    slanted = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])  # against the normals
    tangents = np.cross(slanted, normals)
    tangents /= np.sqrt(np.einsum("ij,ij->i", tangents, tangents))[:, None]
    bitangents = np.cross(normals, tangents)
    total = np.zeros((len(points), 3))
    for i in range(directions):
        across = np.sqrt((i + 0.5) / directions)
        turn = i * np.pi * (3.0 - 5.0**0.5)
        around = across * (np.cos(turn) * tangents + np.sin(turn) * bitangents)
        total += lit.traced(points, around + np.sqrt(1.0 - across**2) * normals)[0]
    return total / directions
