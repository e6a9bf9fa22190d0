"""transforms.json, in the dialects of nerfstudio (also Instant NGP's) and of the Blender scenes of NeRF.

Both list ``frames`` with a ``transform_matrix``, camera to world, in OpenGL axes (x right, y up, z backward), which
become COLMAP's by negating y and z. nerfstudio gives ``fl_x fl_y cx cy w h`` per file or per frame; Blender gives
``camera_angle_x`` (radians, over the image's width). Without ``w`` and ``h``, the size is that of the image file, or,
if that is missing, of the first image file that exists.

World coordinates are those of the file, since a model trained from it uses them. nerfstudio's ``applied_transform``
from COLMAP's world is not undone; for a model in COLMAP's world, read the COLMAP folder.

Source: https://docs.nerf.studio/quickstart/data_conventions.html.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gspure.cameras.camera import Camera, intrinsics, rigid
from gspure.cameras.entry import Entry, with_finite_poses
from gspure.cameras.photographs import located, photograph_size, safe_name, view_names
from gspure.errors import InputError
from gspure.files import read_json
from gspure.progress import warn

_PINHOLES = frozenset({"OPENCV", "PERSPECTIVE", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"})
_OTHER_LENSES = ("is_fisheye", "latlong", "equirectangular", *(f"ftheta_p{i}" for i in range(5)), "k4", "k5", "k6")
"""Flags and coefficients of lenses that are no pinhole: Instant NGP's, and coefficients on which readers disagree."""
_OTHER_AXES = ("from_na", "from_mitsuba")  # flags of Instant NGP
_HINT = "undistort the photographs first, for example with colmap image_undistorter"
_OPENGL_TO_COLMAP = np.diag([1.0, -1.0, -1.0])


def parse(source: Path, content: Mapping[str, Any]) -> list[Camera]:
    """Return the cameras of a parsed transforms.json, in its order; `source` is the file it came from."""
    entries = frames_of(Entry(source, "", content))
    if any("mask_path" in entry for entry in entries):
        warn(f"{source}: mask_path is not used: masked pixels count in training and metrics")
    names = view_names(entries, "file_path", source)
    files = [entry.text("file_path") for entry in entries]
    # Blender scenes omit the suffix.
    expected_images = [source.parent / (file if Path(file).suffix else f"{file}.png") for file in files]
    images = located(files, expected_images, source.parent)
    existing = next(filter(Path.is_file, images), None)
    views = zip(entries, names, images, strict=True)
    return [_camera(entry, name, image, existing) for entry, name, image in views]


def frames_of(scene: Entry) -> list[Entry]:
    """Return the frames of a transforms.json, completed with what they share, without those of unusable poses."""
    frames = scene.value("frames", "a list", lambda value: isinstance(value, list))
    shared = {key: value for key, value in scene.values.items() if key != "frames"}
    completed = (shared | frame if isinstance(frame, dict) else frame for frame in frames)
    entries = [Entry(scene.source, f"frames[{i}]", frame) for i, frame in enumerate(completed)]
    return with_finite_poses(entries, "file_path", "transform_matrix")


def parse_poses(source: Path, content: list[Any]) -> list[Camera]:
    """Return the cameras of a list of poses written by ``ns-export cameras``, in the world of the model.

    Their optics are those of the transforms.json beside the file or above the photographs.
    """
    poses = [Entry(source, f"[{i}]", pose) for i, pose in enumerate(content)]
    folders = [Path(), *Path(poses[0].text("file_path")).parents]
    captures = (source.parent / folder / "transforms.json" for folder in folders)
    capture = next((path for path in captures if path.is_file()), None)
    if capture is None:
        hint = "copy the transforms.json of the capture there"
        raise InputError(source, "optics", expected="a transforms.json beside the file", found="none", hint=hint)
    scene = Entry(capture, "", read_json(capture))
    stored = scene.value("frames", "a list of objects", lambda value: all(isinstance(frame, dict) for frame in value))
    optics = {safe_name(str(frame.get("file_path"))): frame for frame in stored}
    frames = []
    for pose in poses:
        file = pose.text("file_path")
        matrix = pose.array("transform", (3, 4)).tolist()
        frames.append({**optics.get(safe_name(file), {}), "file_path": file, "transform_matrix": matrix})
    return parse(source, {**scene.values, "frames": frames})


def _camera(entry: Entry, name: str, image: Path, existing: Path | None) -> Camera:
    _require_opengl_pinhole(entry)
    if "w" in entry:
        width = entry.pixels("w")
        height = entry.pixels("h")
    else:
        width, height = photograph_size(image if image.is_file() else existing or image)
    fx = _focal(entry, "x", width)
    fy = _focal(entry, "y", height) if "fl_y" in entry or "camera_angle_y" in entry else fx
    K = intrinsics(fx, fy, entry.number("cx", width / 2), entry.number("cy", height / 2))
    pose = entry.rigid("transform_matrix", (4, 4), (3, 4))
    rotation = _OPENGL_TO_COLMAP @ pose[:3, :3].T
    return Camera(name, width, height, K, rigid(rotation, -rotation @ pose[:3, 3]), image, entry.distortion())


def _require_opengl_pinhole(entry: Entry) -> None:
    if "camera_model" in entry and entry.text("camera_model") not in _PINHOLES:
        model = entry.text("camera_model")
        raise entry.refusal("camera_model", expected="a pinhole camera", found=model, hint=_HINT)
    for key in filter(entry.values.get, _OTHER_LENSES):
        raise entry.refusal(key, expected="a pinhole camera", found=repr(entry.values[key]), hint=_HINT)
    for key in filter(entry.values.get, _OTHER_AXES):
        raise entry.refusal(key, expected="OpenGL axes", found=repr(entry.values[key]))


def _focal(entry: Entry, axis: str, length: int) -> float:
    """Return the focal length in pixels, from ``fl_*`` or the field of view."""
    if f"fl_{axis}" in entry or f"camera_angle_{axis}" not in entry:
        return entry.positive(f"fl_{axis}")
    angle = entry.positive(f"camera_angle_{axis}")
    if angle >= math.pi:
        raise entry.refusal(f"camera_angle_{axis}", expected="less than pi radians", found=str(angle))
    return length / 2 / math.tan(angle / 2)
