"""The records of a COLMAP sparse model, and the parameters of its cameras.

Source: https://colmap.github.io/format.html and https://colmap.github.io/cameras.html.
"""

from pathlib import Path
from typing import NamedTuple

from gspure.errors import InputError
from gspure.files import Float64, UInt8

MODEL_NAMES = (
    "SIMPLE_PINHOLE",
    "PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
    "OPENCV_FISHEYE",
    "FULL_OPENCV",
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
    "RAD_TAN_THIN_PRISM_FISHEYE",
)
"""Camera models by their number in the binary format."""

_HINT = "undistort first: colmap image_undistorter --image_path PHOTOS --input_path SPARSE --output_path UNDISTORTED"
_FOUR = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")

_PARAMETERS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": _FOUR,
    "FULL_OPENCV": (*_FOUR, "k3", "k4", "k5", "k6"),
}


class Lens(NamedTuple):
    """One line of cameras.txt: intrinsics, shared by one or more images."""

    camera_id: int
    width: int
    height: int
    parameters: dict[str, float]


class Pose(NamedTuple):
    """The first of an image's two lines in images.txt: `quat` (w, x, y, z) and `translation` map world to camera."""

    image_id: int
    quat: tuple[float, ...]
    translation: tuple[float, ...]
    camera_id: int
    name: str


class Points(NamedTuple):
    """The sparse point cloud: positions [P,3] in world units and 8-bit colours [P,3]."""

    xyz: Float64
    rgb: UInt8


def parameter_names(source: Path, camera_id: int, model: str) -> tuple[str, ...]:
    """Return the names of a camera model's parameters; a fisheye model is refused."""
    if model not in _PARAMETERS:
        expected = f"one of {', '.join(_PARAMETERS)}"
        raise InputError(source, f"camera {camera_id}.model", expected=expected, found=model, hint=_HINT)
    return _PARAMETERS[model]
