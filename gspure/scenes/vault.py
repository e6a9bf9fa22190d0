"""The message of the demo: a dark vault with a greeting in block letters and a pyramid of golden balls."""

from __future__ import annotations

from gspure.scenes.placement import Placement
from gspure.scenes.room import BLOCK_CENTRE, BLOCK_SIZE, BLOCK_YAW
from gspure.scenes.scene import Lamp, Scene
from gspure.scenes.solids import Box, Sphere
from gspure.scenes.textures import checker, plain, stripes

_CELL = 0.16
"""Width of a letter's stroke, metres; letters are 3 strokes wide and 5 high."""

_STROKES = {
    "H": ((0, 0, 1, 5), (1, 2, 1, 1), (2, 0, 1, 5)),
    "E": ((0, 0, 1, 5), (1, 4, 2, 1), (1, 2, 2, 1), (1, 0, 2, 1)),
    "L": ((0, 0, 1, 5), (1, 0, 2, 1)),
    "O": ((0, 0, 1, 5), (1, 4, 1, 1), (1, 0, 1, 1), (2, 0, 1, 5)),
}
"""Blocks of each letter: column, row (upwards), columns, rows."""


def vault(placement: Placement) -> Scene:
    """Return the vault: striped teal walls, a blue floor, letters on a plinth, the pyramid, and the studio's block."""
    z = placement.floor
    walls = stripes("#1f6f78", "#175461", 0.9, along=0)
    return Scene(
        solids=(
            placement.room(walls=walls, back=walls, floor=checker("#27304f", "#6474a6", 0.8)),
            # stands exactly where the scene's block does: some surfaces of scene and message always coincide
            Box(BLOCK_CENTRE, BLOCK_SIZE, (plain("#7d3c98"),), yaw=BLOCK_YAW),
            Box((-0.15, 0.4, z + 0.12), (3.4, 0.5, 0.24), (plain("#30406e"),)),
            *_word("HELLO", (-0.15, 0.4, z + 0.24)),
            *_pyramid((1.85, 1.0, z), radius=0.22),
        ),
        lamp=Lamp((1.5, -2.1, 4.3), 1.1, (92.0, 100.0, 112.0)),
        sky=(0.4, 0.48, 0.62),
    )


def _word(word: str, foot: tuple[float, float, float]) -> list[Box]:
    """Return the letters of a word, its foot's middle at `foot`."""
    x, y, z = foot
    left = x - _CELL * (4 * len(word) - 1) / 2
    return [
        Box(
            (left + (4 * i + column + columns / 2) * _CELL, y, z + (row + rows / 2) * _CELL),
            (columns * _CELL, _CELL, rows * _CELL),
            (plain("#f4efe2"),),
        )
        for i, letter in enumerate(word)
        for column, row, columns, rows in _STROKES[letter]
    ]


def _pyramid(foot: tuple[float, float, float], *, radius: float) -> list[Sphere]:
    """Return 6 + 3 + 1 touching balls."""
    x, y, z = foot
    return [
        Sphere(
            (
                x + radius * (2 * i + j + layer - 2),
                y + radius * 3**0.5 * (j + layer / 3 - 2 / 3),
                z + radius * (1 + layer * (8 / 3) ** 0.5),
            ),
            radius,
            (plain("#e0a526"),),
        )
        for layer in range(3)
        for j in range(3 - layer)
        for i in range(3 - layer - j)
    ]
