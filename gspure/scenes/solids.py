"""The solids that scenes are built of, boxes, rooms (boxes seen from inside) and spheres, and their textures.

A solid has one or more faces, each with a chart: unit coordinates (u, v) in [0, 1]^2 to points of the surface. World z
points up. All arithmetic is element by element in float64, so it does not depend on a BLAS library or its threads.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from math import hypot

import numpy as np

from gspure.arrays import Bools, Float64, Indices

Vector = tuple[float, float, float]

Texture = Callable[[Float64], Float64]
"""From places [N,2] in metres along a surface's two directions to reflectances [N,3], linear, 0 to 1."""

GAMMA = 2.2  # exponent between linear light and display values

_NO_HIT_BEFORE = 1e-6  # hits nearer than this (metres) are the surface that the ray starts on
LEFT, RIGHT, FRONT, BACK, BOTTOM, TOP = range(6)  # faces of a box: low and high x, low and high y, low and high z
_IN_FACE_AXES = ((1, 2), (0, 2), (0, 1))  # the two axes along which a face perpendicular to x, y or z extends: u and v


@dataclass(frozen=True, eq=False)
class Box:
    """A box, turned by `yaw` radians about the vertical; centre and edge lengths are in metres.

    It has one texture for all faces or six by face number, and only some `faces`, by default all but the bottom.
    """

    centre: Vector
    size: Vector
    textures: tuple[Texture, ...]
    yaw: float = 0.0
    faces: tuple[int, ...] = (LEFT, RIGHT, FRONT, BACK, TOP)

    @cached_property
    def extents(self) -> Float64:
        """Edge lengths [6,2] along u and v, metres."""
        return np.array([[self.size[axis] for axis in _IN_FACE_AXES[face // 2]] for face in range(6)])

    @property
    def bound(self) -> tuple[Vector, float]:
        """Centre and radius of the sphere through the corners: rays hit the box only within it."""
        return self.centre, 0.5 * hypot(*self.size)

    def distance(self, origins: Float64, directions: Float64) -> Float64:
        """Return the ray parameter [N] where rays [N,3] enter the box; inf where they miss it."""
        near = np.full(len(origins), -np.inf)
        far = np.full(len(origins), np.inf)
        for enters, leaves, _ in self._slabs(origins, directions):
            np.maximum(near, enters, out=near)
            np.minimum(far, leaves, out=far)
        return np.where((near < far) & (near > _NO_HIT_BEFORE), near, np.inf)

    def locate(self, points: Float64) -> tuple[Indices, Float64]:
        """Return the face [N] whose plane is nearest to points [N,3], and their unit coordinates [N,2] on it."""
        local = self._turned(points - np.array(self.centre), -self.yaw) / self.size + 0.5
        outward = np.abs(local - 0.5)
        axis = np.argmax(outward, axis=1)
        coordinates = local.ravel()
        first = np.arange(0, coordinates.size, 3)  # index of each point's x; `take` is faster than `take_along_axis`
        in_face = np.array(_IN_FACE_AXES).take(axis, axis=0)
        uv = coordinates.take(first[:, None] + in_face)
        return 2 * axis + (coordinates.take(first + axis) > 0.5), np.clip(uv, 0.0, 1.0)

    def chart(self, face: int, uv: Float64) -> tuple[Float64, Float64]:
        """Return points [N,3] and outward unit normals [N,3] at unit coordinates [N,2] of a face."""
        axis = face // 2
        side = 2.0 * (face % 2) - 1.0
        local = np.empty((len(uv), 3))
        local[:, axis] = 0.5 * side
        local[:, _IN_FACE_AXES[axis]] = uv - 0.5
        normals = np.zeros((len(uv), 3))
        normals[:, axis] = side
        return self._turned(local * self.size, self.yaw) + np.array(self.centre), self._turned(normals, self.yaw)

    def _slabs(self, origins: Float64, directions: Float64) -> Iterator[tuple[Float64, Float64, Float64]]:
        """Yield per axis the ray parameters [N] where rays enter and leave the slab, and their direction along it."""
        local_origins = self._turned(origins - np.array(self.centre), -self.yaw)
        local_directions = self._turned(directions, -self.yaw)
        for axis in range(3):
            along = local_directions[:, axis]
            inverse = 1.0 / (along + 1e-300)  # a ray within the slab's plane gets a huge parameter
            middle = -local_origins[:, axis] * inverse
            reach = 0.5 * self.size[axis] * np.abs(inverse)
            yield middle - reach, middle + reach, along

    @staticmethod
    def _turned(vectors: Float64, yaw: float) -> Float64:
        if yaw == 0.0:
            return vectors
        x, y, z = vectors.T
        cos = np.cos(yaw)
        sin = np.sin(yaw)
        return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)


@dataclass(frozen=True, eq=False)
class Room(Box):
    """A box seen from inside, by default open to the front and to the sky."""

    faces: tuple[int, ...] = (LEFT, RIGHT, BACK, BOTTOM)

    @property
    def bound(self) -> tuple[Vector, float]:
        """The centre, and an infinite radius: a room surrounds its rays."""
        return self.centre, np.inf

    def distance(self, origins: Float64, directions: Float64) -> Float64:
        """Return the ray parameter [N] where rays leave the box through one of its faces."""
        near = np.full(len(origins), -np.inf)
        far = np.full(len(origins), np.inf)
        exists = np.zeros(len(origins), np.bool_)
        for axis, (enters, leaves, along) in enumerate(self._slabs(origins, directions)):
            has_low = 2 * axis in self.faces
            has_high = 2 * axis + 1 in self.faces
            exists = np.where(leaves < far, np.where(along > 0.0, has_high, has_low), exists)
            np.maximum(near, enters, out=near)
            np.minimum(far, leaves, out=far)
        return np.where(exists & (near < far) & (far > _NO_HIT_BEFORE), far, np.inf)

    def chart(self, face: int, uv: Float64) -> tuple[Float64, Float64]:
        """Return points and inward normals of a face."""
        points, normals = super().chart(face, uv)
        return points, -normals


@dataclass(frozen=True, eq=False)
class Sphere:
    """A sphere; u runs around the vertical, v from the top down."""

    centre: Vector
    radius: float
    textures: tuple[Texture, ...]
    faces: tuple[int, ...] = (0,)

    @property
    def extents(self) -> Float64:
        """Lengths [1,2] of the equator and of a meridian."""
        return np.array([[2.0 * np.pi * self.radius, np.pi * self.radius]])

    @property
    def bound(self) -> tuple[Vector, float]:
        """Centre and radius."""
        return self.centre, self.radius

    def distance(self, origins: Float64, directions: Float64) -> Float64:
        """Return the ray parameter [N] where rays enter the sphere."""
        to_centre = np.array(self.centre) - origins
        a = np.einsum("ij,ij->i", directions, directions)
        b = np.einsum("ij,ij->i", directions, to_centre)
        c = np.einsum("ij,ij->i", to_centre, to_centre) - self.radius**2
        discriminant = b * b - a * c
        near = (b - np.sqrt(np.maximum(discriminant, 0.0))) / a
        return np.where((discriminant > 0.0) & (near > _NO_HIT_BEFORE), near, np.inf)

    def locate(self, points: Float64) -> tuple[Indices, Float64]:
        """Return face 0, and longitude and colatitude as unit coordinates."""
        local = (points - np.array(self.centre)) / self.radius
        u = np.arctan2(local[:, 1], local[:, 0]) / (2.0 * np.pi) + 0.5
        v = np.arccos(np.clip(local[:, 2], -1.0, 1.0)) / np.pi
        return np.zeros(len(points), np.intp), np.stack([u, v], axis=1)

    def chart(self, face: int, uv: Float64) -> tuple[Float64, Float64]:  # noqa: ARG002  (one face only)
        """Return points and outward normals."""
        longitude = 2.0 * np.pi * (uv[:, 0] - 0.5)
        colatitude = np.pi * uv[:, 1]
        ring = np.sin(colatitude)
        normals = np.stack([ring * np.cos(longitude), ring * np.sin(longitude), np.cos(colatitude)], axis=1)
        return np.array(self.centre) + self.radius * normals, normals


Solid = Box | Sphere  # what scenes are built of


def reflectance(colour: str) -> Float64:
    """Return the linear reflectance [3] of a display colour ``#rrggbb``."""
    channels: Float64 = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return channels**GAMMA


def plain(colour: str) -> Texture:
    """Return one colour everywhere."""
    value = reflectance(colour)
    return lambda places: np.broadcast_to(value, (len(places), 3))


def checker(first: str, second: str, size: float) -> Texture:
    """Return squares of `size` metres in two alternating colours."""
    return lambda places: _choose(np.floor(places / size).sum(axis=1) % 2 == 0, first, second)


def stripes(first: str, second: str, size: float, *, along: int) -> Texture:
    """Return bands of `size` metres that alternate along direction `along` (0 or 1)."""
    return lambda places: _choose(np.floor(places[:, along] / size) % 2 == 0, first, second)


def banded(lower: str, upper: str, height: float) -> Texture:
    """Return one colour up to `height` metres in the second direction, and another above it."""
    return lambda places: _choose(places[:, 1] < height, lower, upper)


def rings(first: str, second: str, size: float) -> Texture:
    """Return concentric rings of `size` metres around the origin in two alternating colours."""
    return lambda places: _choose(np.floor(np.sqrt((places**2).sum(axis=1)) / size) % 2 == 0, first, second)


def inlaid(outer: Texture, inner: Texture, centre: tuple[float, float], size: tuple[float, float]) -> Texture:
    """Return one texture with a rectangle of another laid into it, whose origin is the rectangle's centre."""

    def at(places: Float64) -> Float64:
        local = places - centre
        inside = (np.abs(local) <= np.array(size) / 2.0).all(axis=1, keepdims=True)
        return np.where(inside, inner(local), outer(places))

    return at


def _choose(is_first: Bools, first: str, second: str) -> Float64:
    return np.stack([reflectance(second), reflectance(first)]).take(is_first, axis=0)
