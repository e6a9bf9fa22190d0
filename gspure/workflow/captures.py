"""Files of a capture or model: they are inputs of the workflow, so an edit of one makes its results stale."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from gspure.cameras.reading import CAMERA_FILES
from gspure.model import model_file
from gspure.model.compressed.sog import INDEX
from gspure.schemes.registry import schemes
from gspure.training.dataset import BLENDER_HELD_OUT, POINT_FILES


def camera_files(source: str) -> list[str]:
    """Return the files of the cameras of `source`, a folder or a file of cameras."""
    return _files(source, CAMERA_FILES)


def capture_files(source: str, photographs: Sequence[str]) -> list[str]:
    """Return the files of the cameras and points of `source`, a folder or a file of cameras, and its photographs."""
    folder = Path(source) if Path(source).is_dir() else Path(source).parent
    names = [*BLENDER_HELD_OUT, "points3D.bin", "points3D.txt", *POINT_FILES]
    return [*camera_files(source), *_files(str(folder), names), *photographs]


def model_files(source: str) -> list[str]:
    """Return the file of a model, a file or a training run's folder, and all that may be read with it.

    That is cfg_args and the networks of schemes, beside the file or, for a model in ``point_cloud/iteration_N``, in the
    run's folder; and the images beside the index of an unpacked SOG model.
    """
    model = model_file(Path(source))
    folders = [model.parent, *([model.parents[2]] if model.parent.match("point_cloud/iteration_*") else [])]
    images = ["*.webp"] if model.name == INDEX else []
    patterns = ["cfg_args", *images, *_networks()]
    beside = {str(file) for folder in folders for pattern in patterns for file in folder.glob(pattern)}
    return [str(model), *sorted(beside)]


@cache
def _networks() -> list[str]:
    return [pattern for scheme in schemes().values() for pattern in scheme.beside]


def _files(source: str, names: Sequence[str]) -> list[str]:
    """Return the files of these names in a folder or its COLMAP model; a file stands for itself."""
    if not Path(source).is_dir():
        return [source]
    paths = [Path(source, place, name) for place in ("", "sparse/0", "sparse") for name in names]
    return [str(path) for path in paths if path.exists()]
