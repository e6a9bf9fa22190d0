"""Planted messages without the photographs of a pair, which planting does not look at."""

from types import SimpleNamespace

import numpy as np
from planted import PlantedKey, embed

from gspure.public_model import PublicModel

CENTRES = {"scene": (0.0, 0.5, 0.75), "message": (0.4, 0.7, 0.5)}  # before the cameras of a ray-traced pair
POINTS = 3000


def planted_model(seed: int = 0, **settings) -> tuple[PublicModel, PlantedKey]:
    """Return a public model and its key: two coloured balls, one in the other."""
    rng = np.random.default_rng(0)
    captures = {}
    for name, centre in CENTRES.items():
        directions = rng.standard_normal((POINTS, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        dataset = SimpleNamespace(xyz=directions + centre, rgb=rng.integers(256, size=(POINTS, 3)).astype(np.uint8))
        captures[name] = SimpleNamespace(dataset=dataset)
    return embed(SimpleNamespace(**captures), seed, **settings)
