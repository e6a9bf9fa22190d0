"""The user's files that jobs read: models, cameras, photographs, and the pairs made from them."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from gspure.cameras.reading import CAMERA_FILES, camera_places
from gspure.cameras.worlds import NORMALIZED
from gspure.files import digest
from gspure.model import model_file
from gspure.model.inria import UNPACKED_SOG
from gspure.schemes.registry import schemes
from gspure.training.dataset import BLENDER_HELD_OUT, POINT_FILES

Settings = Mapping[str, Any]

SMALL_IMAGE: Final = 256 * 256  # pixels: so few tiles give a second thread little to do; ours


def pair_of(scene: str) -> str:
    """Return the pair of a model's scene: ``raised``, of ``raised@1``."""
    return scene.partition("@")[0]


def is_photographed(pair: Settings) -> bool:
    """Return whether a pair is made from photographs, rather than ray-traced."""
    return "photographs" in pair


def is_small(pair: Settings) -> bool:
    """Return whether the images of a pair are too small for more than one thread."""
    return not is_photographed(pair) and pair["width"] * pair["height"] <= SMALL_IMAGE


def message_name(pair: Settings) -> str:
    """Return the name of a message's trained model: that of its folder and a digest of its training settings."""
    settings = [str(pair[name]) for name in ("message", "iterations", "resolution", "seed")]
    return f"{Path(pair['message']).stem}-{digest(*settings)[:8]}"


def message_model(pair: Settings) -> str:
    """Return the model of a photographed pair's message: the user's, or the one trained for all pairs that hide it."""
    return f"results/messages/{message_name(pair)}" if "message_photographs" in pair else str(pair["message"])


def pair_settings(pair: Settings) -> dict[str, Any]:
    """Return the settings of an entry of ``pairs`` that apply to it."""
    names = ("protocol", "placement", "views", "width", "height", "seed")
    return {name: pair[name] for name in (("protocol", "resolution", "seed") if is_photographed(pair) else names)}


def pair_files(pair: Settings) -> list[str]:
    """Return the user's files that a pair is made from: photographs and the message's model; none if ray-traced."""
    if not is_photographed(pair):
        return []
    scene = capture_files(pair["scene"], pair["photographs"])
    if "own_photographs" in pair:
        return [*scene, *capture_files(pair["message"], pair["own_photographs"])]
    if "message_photographs" in pair:
        return scene
    return [*scene, *model_files(pair["message"]), *camera_files(pair["message"])]


def message_of(pair: Settings) -> str:
    """Return what tells the message of a pair from that of another."""
    message = str(pair["message"])
    return os.path.realpath(message) if is_photographed(pair) else message


def camera_files(source: str) -> list[str]:
    """Return the files of the cameras of `source`, a folder or a file of cameras."""
    return _files(source, [*CAMERA_FILES, NORMALIZED])


def capture_files(source: str, photographs: Sequence[str]) -> list[str]:
    """Return the files of the cameras and points of `source`, a folder or a file of cameras, and its photographs."""
    folder = Path(source) if Path(source).is_dir() else Path(source).parent
    names = [*BLENDER_HELD_OUT, "points3D.bin", "points3D.txt", *POINT_FILES]
    return [*camera_files(source), *_files(str(folder), names), *photographs]


def model_files(source: str) -> list[str]:
    """Return the file of a model, a file or a training run's folder, and all that may be read with it.

    That is cfg_args, nerfstudio's transforms and the networks of schemes, beside the file or, for a model in
    ``point_cloud/iteration_N``, in the run's folder; and the images beside the index of an unpacked SOG model.
    """
    model = model_file(Path(source))
    folders = [model.parent, *([model.parents[2]] if model.parent.match("point_cloud/iteration_*") else [])]
    networks = [pattern for scheme in schemes().values() for pattern in scheme.beside]
    patterns = ["cfg_args", NORMALIZED, *(["*.webp"] if model.name == UNPACKED_SOG else []), *networks]
    beside = {str(file) for folder in folders for pattern in patterns for file in folder.glob(pattern)}
    return [str(model), *sorted(beside)]


def _files(source: str, names: Sequence[str]) -> list[str]:
    """Return the files of these names in a folder, its COLMAP model or `camera_places`; a file stands for itself."""
    if not Path(source).is_dir():
        return [source]
    places = (place if place.is_dir() else place.parent for place in camera_places(Path(source)))
    folders = dict.fromkeys([Path(source), Path(source, "sparse/0"), Path(source, "sparse"), *places])
    return [str(path) for folder in folders for name in names if (path := folder / name).exists()]
