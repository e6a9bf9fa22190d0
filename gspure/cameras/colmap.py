"""COLMAP sparse models: cameras, images and points3D, binary or text.

Axes and pixel convention are those of `gspure.cameras.camera.Camera`. All camera models are read but those of fisheye
lenses.
"""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.cameras.camera import Camera, intrinsics
from gspure.cameras.colmap_files import Lens, Points, Pose, read_lenses_file, read_points_file, read_poses_file
from gspure.cameras.entry import Entry
from gspure.cameras.photographs import distinct, view_name
from gspure.cameras.undistortion import COEFFICIENTS
from gspure.errors import InputError
from gspure.model.ply import require_coordinates
from gspure.model.rotations import rotation_matrices

_SUFFIXES = (".bin", ".txt")


def find_sparse(folder: Path) -> Path | None:
    """Return the folder with cameras.bin or cameras.txt: `folder`, its ``sparse/0`` or its ``sparse``; else None."""
    candidates = (folder, folder / "sparse" / "0", folder / "sparse")
    return next((path for path in candidates if any((path / f"cameras{s}").is_file() for s in _SUFFIXES)), None)


def read_colmap(folder: Path) -> list[Camera]:
    """Read the cameras of a sparse model, in the order of its images file.

    `folder` is the project's root, its ``sparse/0``, or the folder of the files. Photographs are in the nearest
    ``images`` folder beside or above the files. Raise `InputError` if a file is missing, truncated or malformed, or a
    camera has a fisheye lens.
    """
    cameras_file, images_file = _file(folder, "cameras"), _file(folder, "images")
    optics: dict[int, dict[str, Any]] = {}
    for lens in read_lenses_file(cameras_file):
        if lens.camera_id in optics:
            number = f"camera {lens.camera_id}"
            raise InputError(cameras_file, number, expected="one of this number", found="a second one")
        optics[lens.camera_id] = _optics(cameras_file, lens)
    above = images_file.absolute().parents[:3]
    photographs = next((parent / "images" for parent in above if (parent / "images").is_dir()), None)
    cameras = []
    for pose in read_poses_file(images_file):
        if pose.camera_id not in optics:
            where, found = f"image {pose.image_id}.camera_id", str(pose.camera_id)
            raise InputError(images_file, where, expected=f"a camera of {cameras_file.name}", found=found)
        cameras.append(_camera(images_file, pose, optics[pose.camera_id], photographs))
    return distinct(cameras, images_file)


def read_points(folder: Path) -> Points:
    """Read the sparse point cloud: xyz [P,3] in world units and 8-bit rgb [P,3]."""
    path = _file(folder, "points3D")
    points = read_points_file(path)
    require_coordinates(path, points.xyz)
    return points


def _file(folder: Path, stem: str) -> Path:
    sparse = find_sparse(folder) or folder
    for suffix in _SUFFIXES:
        if (path := sparse / f"{stem}{suffix}").is_file():
            return path
    raise InputError(sparse, stem, expected=f"{stem}.bin or {stem}.txt of a COLMAP sparse model", found="neither")


def _optics(source: Path, lens: Lens) -> dict[str, Any]:
    """Return the fields of a `Camera` that a lens determines."""
    entry = Entry(source, f"camera {lens.camera_id}", {"width": lens.width, "height": lens.height, **lens.parameters})
    fx, fy = (entry.positive("f" if "f" in entry else key) for key in ("fx", "fy"))
    K = intrinsics(fx, fy, entry.number("cx"), entry.number("cy"))
    size = {"width": entry.pixels("width"), "height": entry.pixels("height")}
    return {**size, "K": K, "distortion": entry.distortion(COEFFICIENTS)}


def _camera(source: Path, pose: Pose, optics: dict[str, Any], photographs: Path | None) -> Camera:
    values = {"name": pose.name, "quaternion": list(pose.quat), "translation": list(pose.translation)}
    entry = Entry(source, f"image {pose.image_id}", values)
    quat = entry.array("quaternion", (4,))
    if not np.linalg.norm(quat) > 0:
        raise entry.refusal("quaternion", expected="a rotation", found=" ".join(map(str, pose.quat)))
    viewmat = np.eye(4)
    viewmat[:3, :3] = rotation_matrices(quat[None])[0]
    viewmat[:3, 3] = entry.array("translation", (3,))
    image = photographs / pose.name if photographs else None
    return Camera(name=view_name(entry, "name"), viewmat=viewmat, image=image, **optics)
