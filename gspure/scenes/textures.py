"""The textures of solids: patterns of reflectances."""

from collections.abc import Callable

import numpy as np

from gspure.files import Bools, Float64

Texture = Callable[[Float64], Float64]
"""From places [N,2] in metres along a surface's two directions to reflectances [N,3], linear, 0 to 1."""

GAMMA = 2.2  # exponent between linear light and display values


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
