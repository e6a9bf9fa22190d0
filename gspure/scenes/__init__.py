"""Scenes that the project makes itself: ray-traced stages."""

from gspure.scenes.camera_path import stage_cameras
from gspure.scenes.lighting import LitScene, bake
from gspure.scenes.photography import seen_points
from gspure.scenes.placement import PLACEMENTS
from gspure.scenes.ray_tracer import trace
from gspure.scenes.staging import NAMES, PROTOCOLS, Staging, scene_builder

__all__ = [
    "NAMES",
    "PLACEMENTS",
    "PROTOCOLS",
    "LitScene",
    "Staging",
    "bake",
    "scene_builder",
    "seen_points",
    "stage_cameras",
    "trace",
]
