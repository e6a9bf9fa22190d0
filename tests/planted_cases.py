"""Planted messages without the photographs of a pair, which planting does not look at."""

from __future__ import annotations

from types import SimpleNamespace

from gspure.public_model import PublicModel
from gspure.scenes.staging import Staging
from gspure.schemes.planted.embedding import embed
from gspure.schemes.planted.key import PlantedKey

STAGING = Staging("room", "vault", "raised")


def planted_model(seed: int = 0, staging: Staging = STAGING, **settings) -> tuple[PublicModel, PlantedKey]:
    """Return a public model and its key."""
    return embed(SimpleNamespace(staging=staging), seed, **settings)
