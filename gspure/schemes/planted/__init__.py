"""Planted: Gaussians of a second scene with next to no opacity; a test fixture with known ground truth."""

import math

from gspure.public_model import PublicModel
from gspure.schemes.planted.embedding import LEAST_GAUSSIANS, embed
from gspure.schemes.planted.key import PlantedKey
from gspure.schemes.scheme import MESSAGE, Scheme

CARRIERS = {MESSAGE: ("x", "y", "z", "scale_*", "rot_*")}

SCHEME = Scheme(
    "planted",
    embed,
    PublicModel.read,
    PlantedKey.read,
    CARRIERS,
    ranges={"message_weight": (0, 1), "gaussians": (LEAST_GAUSSIANS, math.inf)},
    ray_traced_only=True,
)
