"""The attack that moves what a registration cannot: a smooth warp of the world."""

from typing import Annotated, Final

import numpy as np

from gspure.arrays import Float64
from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked
from gspure.attacks.geometry import radius
from gspure.attacks.strength import Strength
from gspure.model.gaussians import Gaussians
from gspure.settings import Range

AMPLITUDE: Final = 0.003  # in radii of the model; ours: between 0.1 and 1 %
WAVES: Final = 3  # ours
LENGTHS: Final = (1.0, 2.0)  # of waves, in radii; ours


def warp(model: Gaussians, rng: Rng, *, amplitude: Annotated[float, Range(0.0, 1.0)] = AMPLITUDE) -> Attacked:
    """Displace every centre by a sum of three sine waves, in all by at most `amplitude` radii of the model.

    The waves are one to two radii long, so no rigid transform undoes them. Frames stay: at an amplitude of 1 %, they
    would turn and stretch by at most 6 %, which is little for Gaussians that are much smaller than a radius. Anchors,
    which have no frames, can be warped, too.

    Source: ours.
    """
    size = radius(model)
    lengths = rng.uniform(*LENGTHS, WAVES)
    vectors = _directions(rng) * (2 * np.pi / (lengths * size))[:, None]
    waves = np.sin(model.means.astype(np.float64) @ vectors.T + rng.uniform(0, 2 * np.pi, WAVES))
    means = model.means + amplitude * size / WAVES * (waves @ _directions(rng))
    return Attacked.changed(model, dict(zip("xyz", means.astype(np.float32).T, strict=True)))


def _directions(rng: Rng) -> Float64:
    """Return a random unit vector for each wave."""
    vectors = rng.standard_normal((WAVES, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


ATTACKS = named({warp: Strength("amplitude", 1e-5, 0.1, "log")})
