"""The user's files that jobs read: models, cameras, photographs, and the pairs made from them."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from gspure.cameras.photographs import require_present
from gspure.cameras.points import POINT_FILES
from gspure.cameras.reading import CAMERA_FILES, camera_places
from gspure.cameras.worlds import NORMALIZED
from gspure.model import model_file
from gspure.model.inria import model_parts
from gspure.schemes.registry import schemes
from gspure.training.dataset import BLENDER_HELD_OUT, read_views

_POINTS: Final = ("points3D.bin", "points3D.txt", *POINT_FILES)


def photographs(source: str) -> tuple[Path, ...]:
    """Return the photographs of all cameras of training data, held-out ones too; relative if the data is.

    Raise `InputError` if one is missing.
    """
    cameras = [camera for camera in read_views(Path(source)).cameras if camera.image]
    require_present(cameras, source)
    images = [str(camera.image) for camera in cameras]
    if not Path(source).is_absolute():
        images = [os.path.relpath(image) for image in images]
    return tuple(map(Path, images))


def camera_files(source: str) -> tuple[Path, ...]:
    """Return the files of the cameras of `source`, a folder or a file of cameras, and those that tell its world."""
    return _files(source, [*CAMERA_FILES, NORMALIZED, *_POINTS])


def capture_files(source: str) -> tuple[Path, ...]:
    """Return the files of the cameras and points of `source`, a folder or a file of cameras, and its photographs."""
    folder = Path(source) if Path(source).is_dir() else Path(source).parent
    names = [*BLENDER_HELD_OUT, *_POINTS]
    return distinct((*camera_files(source), *_files(str(folder), names), *photographs(source)))


def model_files(source: str | Path) -> tuple[Path, ...]:
    """Return the file of a model, a file or a training run's folder, and all that may be read with it.

    That is cfg_args, nerfstudio's transforms and the networks of schemes, beside the file or, for a model in
    ``point_cloud/iteration_N``, in the run's folder; and the images and chunks of a SOG model.
    """
    model = model_file(Path(source))
    folders = [model.parent]
    if model.parent.match("point_cloud/iteration_*"):
        folders.append(model.parents[2])
    patterns = ["cfg_args", NORMALIZED]
    for scheme in schemes().values():
        patterns += scheme.beside
    beside = {file for folder in folders for pattern in patterns for file in folder.glob(pattern)}
    return (*model_parts(model), *sorted(beside))


def key_files(folder: str) -> tuple[Path, ...]:
    """Return the files of a key."""
    return tuple(sorted(Path(folder).glob("*")))


def distinct(files: Iterable[Path]) -> tuple[Path, ...]:
    """Return files without repetitions, in their order."""
    return tuple(dict.fromkeys(files))


def _files(source: str, names: Sequence[str]) -> tuple[Path, ...]:
    """Return the files of these names in a folder, its COLMAP model or `camera_places`; a file stands for itself."""
    if not Path(source).is_dir():
        return (Path(source),)
    places = (place if place.is_dir() else place.parent for place in camera_places(Path(source)))
    folders = dict.fromkeys([Path(source), Path(source, "sparse/0"), Path(source, "sparse"), *places])
    return tuple(path for folder in folders for name in names if (path := folder / name).exists())
