"""Scenes by name; random ones by seed: furnished rooms, landscapes under a sky, objects over black."""

from collections.abc import Callable, Iterator, Sequence
from colorsys import hsv_to_rgb
from functools import partial
from itertools import product
from typing import Final

import numpy as np

from gspure.scenes.lighting import Lamp, Scene
from gspure.scenes.rooms import HALF_WIDTH, Placement, room, vault
from gspure.scenes.solids import (
    Box,
    Room,
    Solid,
    Sphere,
    Texture,
    Vector,
    banded,
    checker,
    inlaid,
    plain,
    rings,
    stripes,
)
from gspure.settings import SEED

Random = np.random.Generator
Interval = tuple[float, float]
BuildScene = Callable[[Placement], Scene]
BuildSolids = Callable[[Vector, Random], Iterator[Solid]]  # on a foot's place

NAMES: Final = "room, vault, interior-SEED, landscape-SEED, object-SEED"  # of ray-traced scenes; SEED is a number
FRONT_HALF: Final = ((-2.0, 2.0), (-0.5, 2.2))  # x and y that all cameras see well, metres: where objects stand

GRID: Final = 10  # a landscape has this many by this many steps of terrain
PLINTH_SIZE: Final = (2.6, 1.2, 0.3)  # width, depth and height of an object's plinth, metres
SKY_HEIGHT: Final = 9.0  # height of the painted sky around a landscape, metres


def scene_builder(name: str) -> BuildScene | None:
    """Return the builder of a ray-traced scene; None if no such scene has this name."""
    kind, _, seed = name.partition("-")
    number = SEED.parse(seed)
    if kind in PROCEDURAL and number is not None and seed == str(number):
        return partial(PROCEDURAL[kind], int(number))
    return {"room": room, "vault": vault}.get(name)


def interior(seed: int, placement: Placement) -> Scene:
    """Return a room with furniture; walls, floor, objects and lamp are drawn from the seed."""
    rng = np.random.default_rng([0, seed])
    walls = _pattern(rng, 0.5, 1.1, lightness=(0.55, 0.95))
    back = inlaid(walls, _pattern(rng, 0.12, 0.3), centre=(rng.uniform(1.5, 4.5), 2.0), size=(1.5, 1.1))
    tiles = _pattern(rng, 0.3, 0.7)
    rug = _pattern(rng, 0.15, 0.4)
    floor = inlaid(tiles, rug, centre=(rng.uniform(2, 4), 2.9), size=(2.6, 1.8))
    objects = _arranged((_table, _tower, _shelf, _balls, _balls), placement.floor, rng)
    return Scene((placement.room(walls=walls, back=back, floor=floor), *objects), _lamp(rng), _light(rng, 0.48))


def landscape(seed: int, placement: Placement) -> Scene:
    """Return stepped hills with trees, rocks and huts before a painted sky; only the placement's floor counts."""
    rng = np.random.default_rng([1, seed])
    ground = _pattern(rng, 0.3, 0.8, hue=(0.15, 0.4))
    sky = plain(_colour(rng, hue=(0.52, 0.62), value=(0.85, 0.95)))
    size = (4 * HALF_WIDTH, 4 * HALF_WIDTH, SKY_HEIGHT)
    backdrop = Room((0.0, 0.0, placement.floor + SKY_HEIGHT / 2), size, (sky, sky, sky, sky, ground, sky))
    objects = _arranged((_tree, _tree, _hut, _balls, _tree), placement.floor, rng)
    hills = list(_hills(placement.floor, rng))
    lamp = Lamp((rng.uniform(-2.5, 2.5), -2.5, 5.0), 1.6, _light(rng, 75.0))
    return Scene((backdrop, *hills, *objects), lamp, (0.6, 0.66, 0.75))


def plinth(seed: int, placement: Placement) -> Scene:
    """Return a tower, a shelf and balls on a plinth over a black background; only the placement's floor counts."""
    rng = np.random.default_rng([2, seed])
    top = placement.floor + PLINTH_SIZE[2]
    base = Box((0.0, 0.5, placement.floor + PLINTH_SIZE[2] / 2), PLINTH_SIZE, (_pattern(rng, 0.15, 0.4),))
    placed = zip((_tower, _shelf, _balls), rng.permutation([-0.75, 0.0, 0.75]), strict=True)
    objects = [solid for build, x in placed for solid in build((x, 0.5, top), rng)]
    return Scene((base, *objects), _lamp(rng), _light(rng, 0.48))


BuildFromSeed = Callable[[int, Placement], Scene]
PROCEDURAL: Final[dict[str, BuildFromSeed]] = {"interior": interior, "landscape": landscape, "object": plinth}
"""Random scenes, by the first part of their names. Their seeds are independent."""


def _arranged(builders: Sequence[BuildSolids], floor: float, rng: Random) -> list[Solid]:
    """Return objects beside each other, in random order, so that they seldom hide each other."""
    (left, right), (front, rear) = FRONT_HALF
    width = (right - left) / len(builders)
    places = [(left + (i + rng.uniform(0.3, 0.7)) * width, rng.uniform(front, rear)) for i, _ in enumerate(builders)]
    placed = zip(builders, rng.permutation(places), strict=True)
    return [solid for build, (x, y) in placed for solid in build((x, y, floor), rng)]


def _lamp(rng: Random) -> Lamp:
    return Lamp((rng.uniform(-1.6, 1.6), -2.0, 4.3), 1.1, _light(rng, 90.0))


def _table(foot: Vector, rng: Random) -> Iterator[Solid]:
    x, y, z = foot
    long, deep, high = rng.uniform((0.8, 0.6, 0.5), (1.4, 0.9, 0.8))
    wood = (_pattern(rng, 0.1, 0.2),)
    yield Box((x, y, z + high), (long, deep, 0.08), wood)
    for side, end in product((-0.5, 0.5), repeat=2):
        yield Box((x + side * (long - 0.15), y + end * (deep - 0.15), z + high / 2), (0.1, 0.1, high), wood)
    radius = rng.uniform(0.12, 0.24)
    yield Sphere((x + rng.uniform(-0.2, 0.2), y, z + high + 0.04 + radius), radius, (_pattern(rng, 0.1, 0.2),))


def _tower(foot: Vector, rng: Random) -> Iterator[Solid]:
    x, y, z = foot
    for side in sorted(rng.uniform(0.3, 0.85, 3), reverse=True):
        yield Box((x, y, z + side / 2), (side, side, side), (_pattern(rng, 0.1, 0.3),), yaw=rng.uniform(-0.7, 0.7))
        z += side


def _shelf(foot: Vector, rng: Random) -> Iterator[Solid]:
    x, y, z = foot
    yield Box((x, y, z + 0.08), (0.9, 0.4, 0.16), (_pattern(rng, 0.1, 0.2),))
    for column in np.arange(-0.36, 0.4, 0.12):
        high = rng.uniform(0.4, 1.1)
        yield Box((x + column, y, z + 0.16 + high / 2), (0.11, 0.3, high), (plain(_colour(rng)),))


def _balls(foot: Vector, rng: Random) -> Iterator[Solid]:
    x, y, z = foot
    for turn in np.arange(3) * 2.1 + rng.uniform(0, 6.3):
        radius = rng.uniform(0.12, 0.3)
        centre = (x + 0.35 * np.cos(turn), y + 0.35 * np.sin(turn), z + radius)
        yield Sphere(centre, radius, (_pattern(rng, 0.1, 0.25),))


def _tree(foot: Vector, rng: Random) -> Iterator[Solid]:
    x, y, z = foot
    high = rng.uniform(0.5, 1.2)
    yield Box((x, y, z + high / 2), (0.14, 0.14, high), (plain(_colour(rng, hue=(0.05, 0.1), value=(0.3, 0.5))),))
    for _ in range(4):
        dx, dy, dz = rng.uniform((-0.25, -0.25, -0.1), (0.25, 0.25, 0.4))
        leaves = (_pattern(rng, 0.08, 0.2, hue=(0.2, 0.4)),)
        yield Sphere((x + dx, y + dy, z + high + dz), rng.uniform(0.2, 0.38), leaves)


def _hut(foot: Vector, rng: Random) -> Iterator[Solid]:
    x, y, z = foot
    wide = rng.uniform(0.7, 1.1)
    high = rng.uniform(0.5, 0.9)
    yaw = rng.uniform(-0.6, 0.6)
    yield Box((x, y, z + high / 2), (wide, wide, high), (_pattern(rng, 0.15, 0.3),), yaw=yaw)
    for layer in range(4):
        side = (wide + 0.2) * (1 - layer / 4)
        yield Box((x, y, z + high + 0.06 + 0.12 * layer), (side, side, 0.12), (_pattern(rng, 0.1, 0.2),), yaw=yaw)


def _hills(floor: float, rng: Random) -> Iterator[Solid]:
    """Yield a ring of terrain around the open ground: boxes as high as a sum of a few waves, higher in the distance."""
    cells = (np.arange(GRID) + 0.5) / GRID * 4 * HALF_WIDTH - 2 * HALF_WIDTH
    size = cells[1] - cells[0]
    waves = rng.uniform((0.4, 0.4, 0.0, 0.1), (1.2, 1.2, 6.3, 0.3), (4, 4))
    for x, y in product(cells, repeat=2):
        height = sum(a * (1 + np.sin(u * x + v * y + phase)) for u, v, phase, a in waves)
        height *= np.clip(np.hypot(x, y - 0.5) / 3.0 - 0.9, 0.0, 1.2)
        if height > 0.05 and y > -1.5:
            texture = _pattern(rng, 0.2, 0.5, hue=(0.12, 0.4))
            yield Box((x, y, floor + height / 2), (size, size, height), (texture,))


def _pattern(
    rng: Random, least: float, most: float, *, hue: Interval = (0.0, 1.0), lightness: Interval = (0.2, 0.95)
) -> Texture:
    """Return a random pattern of two colours whose parts are `least` to `most` metres wide."""
    first = _colour(rng, hue=hue, value=lightness)
    second = _colour(rng, hue=hue, value=lightness)
    size = rng.uniform(least, most)
    patterns = (
        lambda: plain(first),
        lambda: checker(first, second, size),
        lambda: stripes(first, second, size, along=int(rng.integers(2))),
        lambda: banded(first, second, 2 * size),
        lambda: rings(first, second, size),
    )
    return patterns[rng.integers(len(patterns))]()


def _colour(rng: Random, *, hue: Interval = (0.0, 1.0), value: Interval = (0.2, 0.95)) -> str:
    """Return a random colour ``#rrggbb``."""
    channels = hsv_to_rgb(rng.uniform(*hue), rng.uniform(0.15, 0.75), rng.uniform(*value))
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in channels)


def _light(rng: Random, strength: float) -> Vector:
    red, green, blue = strength * rng.uniform(0.85, 1.15, 3)
    return red, green, blue
