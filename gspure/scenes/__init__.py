"""Scenes that the project makes itself: ray-traced stages."""

from gspure.scenes.camera_path import stage_cameras
from gspure.scenes.lighting import LitScene, bake
from gspure.scenes.placement import PLACEMENTS
from gspure.scenes.ray_tracer import trace
from gspure.scenes.sparse_points import seen_points
from gspure.scenes.staging import STAGES, Staging

__all__ = ["PLACEMENTS", "STAGES", "LitScene", "Staging", "bake", "seen_points", "stage_cameras", "trace"]
