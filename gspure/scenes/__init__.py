"""Scenes that the project makes itself: ray-traced stages, and models in which a message is planted."""

from gspure.scenes.camera_path import stage_cameras
from gspure.scenes.lighting import LitScene, bake
from gspure.scenes.placement import PLACEMENTS
from gspure.scenes.planted import STAGES, Planted, plant
from gspure.scenes.planted_key import PlantedKey, read_key, reveal, write_key
from gspure.scenes.ray_tracer import trace
from gspure.scenes.sparse_points import seen_points

__all__ = [
    "PLACEMENTS",
    "STAGES",
    "LitScene",
    "Planted",
    "PlantedKey",
    "bake",
    "plant",
    "read_key",
    "reveal",
    "seen_points",
    "stage_cameras",
    "trace",
    "write_key",
]
