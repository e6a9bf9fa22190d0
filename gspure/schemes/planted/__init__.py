"""Planted: Gaussians of a second scene with next to no opacity; a test fixture with known ground truth."""

from gspure.public_model import PublicModel
from gspure.schemes.planted.embedding import embed
from gspure.schemes.planted.key import PlantedKey
from gspure.schemes.scheme import MESSAGE, Scheme

CARRIERS = {MESSAGE: ("x", "y", "z", "scale_*", "rot_*")}

SCHEME = Scheme(
    "planted",
    embed,
    PublicModel.read,
    PlantedKey.read,
    CARRIERS,
    ray_traced_only=True,
)
