"""Cameras in the world of a model, where that is not the world of its capture.

nerfstudio turns, centres and scales a capture before it trains on it. ``dataparser_transforms.json`` beside its results
holds ``transform`` [3,4], which moved COLMAP's world, and ``scale``, which then multiplied positions. Between COLMAP's
world and that of a transforms.json are its ``applied_transform`` and ``applied_scale``. A model of a capture far from
the origin lies around an offset, which a comment names.

Source: https://docs.nerf.studio/quickstart/data_conventions.html.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float64
from gspure.cameras.camera import Camera, points_shown, rigid
from gspure.cameras.entry import Entry
from gspure.cameras.reading import camera_object, camera_place
from gspure.files import read_json
from gspure.model import Gaussians, model_file, read_model
from gspure.progress import say, warn
from gspure.text import percent

NORMALIZED: Final = "dataparser_transforms.json"

_IMPLIED: Final = [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]]  # applied by versions that did not write it down
_NERFSTUDIO: Final = re.compile("nerf?studio", re.IGNORECASE)  # some versions spell it without the f
_OFFSET: Final = re.compile(r"gspure offset (\S+) (\S+) (\S+)")

_LEAST_SHOWN: Final = 0.03  # least share of pixels that show the model; ours
_POINTS: Final = 50_000  # number of points and most views by which it is estimated, in images with this longer side
_VIEWS: Final = 8
_SIDE: Final = 32
_LEAST_OPACITY: Final = 1 / 255


def in_world_of(model: Path, cameras: Sequence[Camera], source: Path) -> list[Camera]:
    """Return the cameras of `source` in the world of `model`, a file or folder, and say so if they had to be moved.

    A list of cameras, such as cameras.json, belongs to a model already. All else is a capture, which nerfstudio moved
    as the ``dataparser_transforms.json`` beside the model or the cameras says. The offset of a model moves any cameras
    that are nearer to it than to the origin.
    """
    place, scene = camera_place(source), camera_object(source)
    comments = read_model(model).comments if model_file(model).suffix == ".ply" else ()
    if scene or place.is_dir():
        folders = (path if path.is_dir() else path.parent for path in (model, source, place))
        if file := next((path for folder in folders if (path := folder / NORMALIZED).is_file()), None):
            say(f"{source}: views moved to the world of the model by {file}")
            cameras = _normalized(cameras, Entry(file, "", read_json(file)), scene)
        elif any(_NERFSTUDIO.search(comment) for comment in comments):
            warn(f"{model}: nerfstudio normalizes poses by default: its {NORMALIZED}, put beside, would move {source}")
    centre = np.mean([camera.centre for camera in cameras], axis=0)
    for offset in (np.array(match.groups(), np.float64) for text in comments if (match := _OFFSET.fullmatch(text))):
        if np.linalg.norm(centre - offset) < np.linalg.norm(centre):
            say(f"{source}: views moved by {' '.join(map(str, -offset))}, the offset of {model}")
            cameras = shifted(cameras, -offset)
    return [*cameras]


def shifted(cameras: Sequence[Camera], offset: Float64) -> list[Camera]:
    """Return the cameras moved by `offset` [3]."""
    return [camera.moved(rigid(np.eye(3), offset)) for camera in cameras]


def _normalized(cameras: Sequence[Camera], normalization: Entry, scene: Entry | None) -> list[Camera]:
    """Return the cameras as nerfstudio has trained with them; `scene` is the transforms.json that they come from."""
    move, before, scale = np.eye(4), np.eye(4), normalization.positive("scale")
    move[:3] = normalization.rigid("transform", (3, 4))
    if scene and "applied_transform" in scene:
        before[:3] = scene.rigid("applied_transform", (3, 4))
    elif scene and (Path(scene.source).parent / "colmap" / "sparse" / "0").exists():
        before[:3] = _IMPLIED
    if scene and "applied_scale" in scene:
        scale /= scene.positive("applied_scale")
    back = before @ np.linalg.inv(move)
    to_scale = np.array([[1, 1, 1, scale]] * 3 + [[1] * 4])
    return [replace(camera, viewmat=camera.viewmat @ back * to_scale) for camera in cameras]


def mention_unseen(model: Gaussians, cameras: Sequence[Camera]) -> None:
    """Warn if hardly any pixel of the views shows the model."""
    if (share := share_shown(model, cameras)) < _LEAST_SHOWN:
        warn(f"about {percent(share)} of the pixels show the model: are these its cameras?")


def share_shown(model: Gaussians, cameras: Sequence[Camera]) -> float:
    """Return the share of the views' pixels that show Gaussians, estimated by random points in them and some views."""
    rng = np.random.default_rng(0)
    rows = model[rng.integers(len(model), size=_POINTS)]
    with np.errstate(invalid="ignore", over="ignore"):
        points = rows.means + rng.normal(size=(_POINTS, 3)) * np.median(rows.scales, axis=1, keepdims=True)
    points = points[rows.opacities > _LEAST_OPACITY]
    shares = []
    for camera in cameras[:: -(-len(cameras) // _VIEWS)]:
        size = np.maximum(1, np.array([camera.width, camera.height]) * _SIDE // max(camera.width, camera.height))
        cells = np.zeros(size, bool)
        cells[tuple(points_shown(camera.resized(*size.tolist()), points)[1][:, :2].astype(int).T)] = True
        shares.append(cells.mean())
    return float(np.mean(shares))
