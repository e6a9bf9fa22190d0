"""Reading of cameras in all formats, which are recognized by the content of the path."""

from __future__ import annotations

from pathlib import Path

from gspure.artifacts import read_json
from gspure.cameras import inria, nerfstudio
from gspure.cameras.camera import Camera
from gspure.cameras.colmap import find_sparse, read_colmap
from gspure.errors import InputError

_IN_FOLDER = ("cameras.json", "transforms.json", "transforms_train.json")


def read_cameras(path: str | Path) -> list[Camera]:
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
    if path.is_dir():
        if find_sparse(path):
            return read_colmap(path)
        path = camera_file(path)
    content = read_json(path)
    if isinstance(content, list):
        return inria.parse(path, content)
    if isinstance(content, dict) and "frames" in content:
        return nerfstudio.parse(path, content)
    raise InputError(path, "file", expected="a list of cameras, or an object with frames", found=type(content).__name__)


def camera_file(folder: Path) -> Path:
    """Return the camera file in a folder without a COLMAP sparse model."""
    for name in _IN_FOLDER:
        if (folder / name).is_file():
            return folder / name
    expected = f"a COLMAP sparse model, {', '.join(_IN_FOLDER[:-1])} or {_IN_FOLDER[-1]}"
    raise InputError(folder, "folder", expected=expected, found="none of them")
