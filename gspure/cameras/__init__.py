"""Cameras: poses and intrinsics of views, read from all common formats or generated."""

from gspure.cameras.camera import Camera, intrinsics
from gspure.cameras.colmap import read_points
from gspure.cameras.inria import write_cameras
from gspure.cameras.orbit import GENERATED, bounding_sphere, orbit_cameras, shell_cameras
from gspure.cameras.photographs import require_images, scaled
from gspure.cameras.reading import read_cameras
from gspure.cameras.splits import split

__all__ = [
    "GENERATED",
    "Camera",
    "bounding_sphere",
    "intrinsics",
    "orbit_cameras",
    "read_cameras",
    "read_points",
    "require_images",
    "scaled",
    "shell_cameras",
    "split",
    "write_cameras",
]
