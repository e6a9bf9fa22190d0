"""The Gaussians of an ordinary scene: what shows it, and what contributes little, as in trained models."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gspure.files import Float64
from gspure.scenes.lighting import LitScene
from gspure.scenes.solids import Room, Solid
from gspure.scenes.surfels import Surfels, tile

SHARE = 0.03  # of the scene's Gaussians inside solids; as many float in the air, as many lie faintly on surfaces
SOLID = (0.9, 0.98)  # range of the opacity of Gaussians on surfaces and inside solids
FLOATING = (0.01, 0.1)  # range of the opacity of floaters, even in the logarithm
FAINT = (0.02, 0.4)  # the same of faint Gaussians on surfaces

_INSIDE_SCALE, _FLOATER_SCALE = 0.02, 0.06
"""Standard deviations of the round Gaussians inside solids and in the air, metres."""


def populate(lit: LitScene, count: int, rng: np.random.Generator) -> tuple[Surfels, Float64]:
    """Return `count` Gaussians of a scene and their opacities [count].

    Those on surfaces that no camera sees, which `tile` makes too, are among them.
    """
    few = round(SHARE * count)
    surface = tile(lit, count - 3 * few, rng)
    rooms = [solid for solid in lit.scene.solids if isinstance(solid, Room)]
    others = [solid for solid in lit.scene.solids if not isinstance(solid, Room)]
    parts = [
        (surface, rng.uniform(*SOLID, len(surface))),
        (_strewn(others, _INSIDE_SCALE, surface, few, rng), rng.uniform(*SOLID, few)),
        (_strewn(rooms or others, _FLOATER_SCALE, surface, few, rng), log_even(FLOATING, few, rng)),
        (_film(surface, few, rng), log_even(FAINT, few, rng)),
    ]
    return Surfels.joined(*(surfels for surfels, _ in parts)), np.concatenate([opacities for _, opacities in parts])


def log_even(bounds: tuple[float, float], count: int, rng: np.random.Generator) -> Float64:
    """Return random numbers [count] between bounds, their logarithms evenly distributed."""
    low, high = bounds
    return low * (high / low) ** rng.random(count)


def _strewn(solids: Sequence[Solid], scale: float, like: Surfels, count: int, rng: np.random.Generator) -> Surfels:
    """Return round Gaussians inside solids, in the colours of others."""
    picked, numbers = rng.integers(len(solids), size=count), rng.random((count, 3))
    means = np.empty((count, 3))
    for index, solid in enumerate(solids):
        means[picked == index] = solid.inside(numbers[picked == index])
    other = like[rng.integers(len(like), size=count)]
    return replace(other, means=means, scales=np.full((count, 3), scale))


def _film(surface: Surfels, count: int, rng: np.random.Generator) -> Surfels:
    """Return copies of surfels, moved a little."""
    copied = surface[rng.integers(len(surface), size=count)]
    return replace(copied, means=copied.means + rng.normal(size=(count, 3)) * copied.scales.min(axis=1, keepdims=True))
