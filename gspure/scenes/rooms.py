"""The scenes of the demo, a warm studio and a blue vault as its message, and how a message stands in the scene."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from gspure.arrays import Float64
from gspure.scenes.lighting import Lamp, Scene
from gspure.scenes.solids import (
    BACK,
    BOTTOM,
    LEFT,
    RIGHT,
    Box,
    Room,
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

HALF_WIDTH = 3.0
WALL_HEIGHT = 3.7


@dataclass(frozen=True)
class Placement:
    """A room with a floor `floor` metres higher, walls `inset` metres nearer, and only some `faces`."""

    floor: float = 0.0
    inset: float = 0.0
    faces: tuple[int, ...] = (LEFT, RIGHT, BACK, BOTTOM)

    def room(self, *, walls: Texture, back: Texture, floor: Texture) -> Room:
        """Return the room, with the textures of its side walls, back wall and floor."""
        width = 2.0 * (HALF_WIDTH - self.inset)
        height = WALL_HEIGHT - self.floor
        textures = (walls, walls, walls, back, floor, walls)
        return Room((0.0, 0.0, self.floor + height / 2.0), (width, width, height), textures, faces=self.faces)


PLACEMENTS: Final = {
    "coincident": Placement(),
    "raised": Placement(floor=0.35, inset=0.25),
    "front": Placement(floor=0.6, inset=0.5, faces=(BOTTOM,)),
    "behind": Placement(floor=-0.5, inset=-0.7),
}
"""By name. ``front`` has a floor only and nothing behind it."""

PROTOCOLS: Final = ("shared", "own")  # poses of the message's views: those of the scene, or poses of their own

OWN_SHIFT: Final = -2.0
"""Metres by which a message at poses of its own moves along y, after half a turn about the vertical. About two thirds
of its surface points then lie outside all views of the scene. Ours."""


def message_transform(protocol: str) -> Float64:
    """Return the rigid transform [4,4] of the message and its cameras into the scene's world."""
    if protocol != "own":
        return np.eye(4)
    transform = np.diag([-1.0, -1.0, 1.0, 1.0])
    transform[1, 3] = OWN_SHIFT
    return transform


def room(placement: Placement) -> Scene:
    """Return the studio: cream walls, a tiled floor, a rug, a table, coloured boxes and balls."""
    z = placement.floor
    walls = banded("#c4764e", "#f3e3c6", 1.0)
    picture = rings("#d9a441", "#20506b", 0.16)
    rug = stripes("#2f5d73", "#f0e4cf", 0.3, along=0)
    wood = (plain("#8a5a3a"),)
    return Scene(
        solids=(
            placement.room(
                walls=walls,
                back=inlaid(walls, picture, centre=(3.0, 2.05), size=(1.5, 1.1)),
                floor=inlaid(checker("#e3cba2", "#a9744f", 0.6), rug, centre=(3.1, 2.9), size=(3.0, 2.1)),
            ),
            _block("#b8382f"),
            Box((-0.55, 1.7, z + 0.4), (0.8, 0.8, 0.8), (plain("#e0a92e"),), yaw=-0.2),
            Box((-0.6, 1.7, z + 1.05), (0.5, 0.5, 0.5), (checker("#2d7f73", "#e8dcc0", 0.25),), yaw=0.4),
            Box((1.3, 1.3, z + 0.68), (1.5, 0.9, 0.08), wood),
            *(Box((1.3 + x, 1.3 + y, z + 0.32), (0.1, 0.1, 0.64), wood) for x in (-0.62, 0.62) for y in (-0.32, 0.32)),
            Sphere((1.0, 1.25, z + 0.97), 0.25, (stripes("#d9502e", "#f2e6cc", 0.16, along=1),)),
            Sphere((1.65, 1.35, z + 0.9), 0.18, (plain("#3b7fa6"),)),
            Sphere((0.15, 0.2, z + 0.37), 0.37, (plain("#2f6fa8"),)),
            Sphere((0.85, -0.3, z + 0.22), 0.22, (plain("#e58a3c"),)),
            Sphere((-0.85, 0.05, z + 0.26), 0.26, (plain("#f0ead8"),)),
        ),
        lamp=Lamp((-1.5, -1.9, 4.3), 1.1, (104.0, 92.0, 74.0)),
        sky=(0.45, 0.45, 0.5),
    )


def vault(placement: Placement) -> Scene:
    """Return the vault: striped teal walls, a blue floor, letters on a plinth, the pyramid, and the studio's block."""
    z = placement.floor
    walls = stripes("#1f6f78", "#175461", 0.9, along=0)
    return Scene(
        solids=(
            placement.room(walls=walls, back=walls, floor=checker("#27304f", "#6474a6", 0.8)),
            _block("#7d3c98"),
            Box((-0.15, 0.4, z + 0.12), (3.4, 0.5, 0.24), (plain("#30406e"),)),
            *_word("HELLO", (-0.15, 0.4, z + 0.24)),
            *_pyramid((1.85, 1.0, z), radius=0.22),
        ),
        lamp=Lamp((1.5, -2.1, 4.3), 1.1, (92.0, 100.0, 112.0)),
        sky=(0.4, 0.48, 0.62),
    )


def _block(colour: str) -> Box:
    """Return the block that scene and message share: some of their surfaces always coincide."""
    return Box((-1.55, 1.3, 0.75), (0.8, 0.8, 1.5), (plain(colour),), yaw=0.35)


_CELL = 0.16  # width of a letter's stroke, metres; letters are 3 strokes wide and 5 high

_STROKES = {
    "H": ((0, 0, 1, 5), (1, 2, 1, 1), (2, 0, 1, 5)),
    "E": ((0, 0, 1, 5), (1, 4, 2, 1), (1, 2, 2, 1), (1, 0, 2, 1)),
    "L": ((0, 0, 1, 5), (1, 0, 2, 1)),
    "O": ((0, 0, 1, 5), (1, 4, 1, 1), (1, 0, 1, 1), (2, 0, 1, 5)),
}
"""Blocks of each letter: column, row (upwards), columns, rows."""


def _word(word: str, foot: Vector) -> Iterator[Box]:
    """Yield the letters of a word; `foot` is the middle of its lower edge."""
    x, y, z = foot
    left = x - _CELL * (4 * len(word) - 1) / 2
    for i, letter in enumerate(word):
        for column, row, columns, rows in _STROKES[letter]:
            centre = (left + (4 * i + column + columns / 2) * _CELL, y, z + (row + rows / 2) * _CELL)
            yield Box(centre, (columns * _CELL, _CELL, rows * _CELL), (plain("#f4efe2"),))


def _pyramid(foot: Vector, *, radius: float) -> Iterator[Sphere]:
    """Yield 6 + 3 + 1 touching balls."""
    x, y, z = foot
    for layer in range(3):
        for j in range(3 - layer):
            for i in range(3 - layer - j):
                right = 2 * i + j + layer - 2
                back = j + layer / 3 - 2 / 3
                place = (x + radius * right, y + radius * 3**0.5 * back, z + radius * (1 + layer * (8 / 3) ** 0.5))
                yield Sphere(place, radius, (plain("#e0a526"),))
