"""Reading of cameras in all formats, recognized by the content of the path, and of rigid transforms."""

from pathlib import Path
from typing import Final

import numpy as np

from gspure.cameras import inria, nerfstudio
from gspure.cameras.camera import Camera
from gspure.cameras.colmap import find_sparse, read_colmap
from gspure.cameras.entry import Entry
from gspure.errors import InputError
from gspure.files import Float64, load_array, read_json
from gspure.progress import warn

_IN_FOLDER: Final = ("cameras.json", "transforms.json", "transforms_train.json")

_MOST_SHIFT: Final = 0.25  # of a principal point from the centre, as a share of the image's side
_LEAST_FOCAL: Final = 0.004  # share of the width: a field of view of 179 degrees, the widest of generated views

CAMERA_FILES: Final = ("cameras.bin", "images.bin", "cameras.txt", "images.txt", *_IN_FOLDER)
"""Names of the files that cameras are read from, of all formats."""


def read_cameras(path: str | Path) -> list[Camera]:
    """Read the cameras of a file or folder as `read_lenses` does; a distorted one is refused with an `InputError`."""
    cameras = read_lenses(path)
    for camera in cameras:
        if camera.distortion:
            found = " ".join(f"{value:g}" for value in camera.distortion)
            hint = "undistort first: gspure cameras SOURCE --undistort --out FOLDER/cameras.json"
            raise InputError(path, f"{camera.name}.distortion", expected="none", found=found, hint=hint)
    return cameras


def read_lenses(path: str | Path) -> list[Camera]:
    """Read the cameras of a file or folder, in its order.

    Parameters
    ----------
    path : str or Path
        A cameras.json of 3DGS or of ours, a transforms.json of nerfstudio, Instant NGP or Blender, or a folder: with a
        COLMAP sparse model (in itself, ``sparse/0`` or ``sparse``), else with one of those files, such as 3DGS's output
        folder. COLMAP has priority, since it has principal points and photographs.

    Raises
    ------
    InputError
        There are no cameras, or a field is invalid.

    """
    path = Path(path)
    cameras = read_colmap(path) if path.is_dir() and find_sparse(path) else _read_file(_camera_file(path))
    if odd := [camera.name for camera in cameras if not _fits(camera)]:
        views = f"{len(odd)} of {len(cameras)} views, such as {odd[0]}"
        mismatch = "does not fit the image size: it may be normalized, or belong to another size"
        warn(f"{path}: focal length or principal point of {views}, {mismatch}")
    return cameras


def _fits(camera: Camera) -> bool:
    """Return whether optics are those of a photograph of this size, and not normalized or of another size."""
    size = np.array([camera.width, camera.height])
    focal, centre = camera.K[[0, 1], [0, 1]], camera.K[:2, 2]
    is_central = (np.abs(centre / size - 0.5) <= _MOST_SHIFT).all()
    return bool(is_central and focal[0] >= _LEAST_FOCAL * size[0] and 0.5 * focal[1] <= focal[0] <= 2 * focal[1])


def _read_file(path: Path) -> list[Camera]:
    """Read the cameras of a file."""
    content = read_json(path)
    if isinstance(content, list):
        return inria.parse(path, content)
    if isinstance(content, dict) and "frames" in content:
        return nerfstudio.parse(path, content)
    raise InputError(path, "file", expected="a list of cameras, or an object with frames", found=type(content).__name__)


def camera_object(source: Path) -> Entry | None:
    """Return the object in a camera file or that of a folder, such as a transforms.json; None if it holds no object."""
    if source.is_dir() and find_sparse(source):
        return None
    path = _camera_file(source)
    content = read_json(path)
    return Entry(path, "", content) if isinstance(content, dict) else None


def read_transform(path: Path) -> Float64:
    """Read the rigid transform [4,4] of ``gspure attack --transform``.

    Raise `InputError` if the file is missing or corrupt, or the matrix is not rigid.
    """
    matrix = load_array(path, dtype=np.float64, shape=(4, 4))
    return Entry(path, "", {"array": matrix.tolist()}).rigid("array", (4, 4))


def _camera_file(source: Path) -> Path:
    """Return the camera file in a folder without a COLMAP sparse model; a file stands for itself."""
    if not source.is_dir():
        return source
    files = [source / name for name in _IN_FOLDER if (source / name).is_file()]
    if not files:
        expected = f"a COLMAP sparse model, {', '.join(_IN_FOLDER[:-1])} or {_IN_FOLDER[-1]}"
        raise InputError(source, "folder", expected=expected, found="none of them")
    return files[0]
