"""The sparse points of a capture."""

from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float64, UInt8
from gspure.cameras.colmap import find_sparse, read_points
from gspure.cameras.reading import camera_object, camera_place
from gspure.model.ply import read_point_ply

POINT_FILES: Final = ("points3D.ply", "points3d.ply", "sparse_pc.ply", "input.ply")
"""Files of sparse points beside a camera file: COLMAP's and `gspure pair`'s, 3DGS's for Blender scenes, nerfstudio's,
3DGS's output."""

RANDOM_POINTS: Final = ("points3d.ply", "input.ply")
"""Those that may be random: 3DGS draws points for Blender scenes, and copies what it starts from."""


def stored_points(source: Path) -> tuple[Float64, UInt8]:
    """Return the sparse points of a capture; none without `points_place`."""
    place = points_place(source)
    if place is None:
        return np.empty((0, 3)), np.empty((0, 3), np.uint8)
    return read_points(place) if place.is_dir() else read_point_ply(place)


def points_place(source: Path) -> Path | None:
    """Return the file of points that a capture's transforms.json names, its COLMAP model, or a file beside it."""
    place = camera_place(source)
    scene = camera_object(source)
    folder = source if place.is_dir() else place.parent
    sparse = place if place.is_dir() else find_sparse(folder)
    if scene and "ply_file_path" in scene:
        return Path(scene.source).parent / scene.text("ply_file_path")
    if sparse and any((sparse / f"points3D{suffix}").is_file() for suffix in (".bin", ".txt")):
        return sparse
    files = (parent / name for parent in (folder, sparse or folder) for name in POINT_FILES)
    return next(filter(Path.is_file, files), None)
