"""Cameras in the world of a model, where that differs from the world of its capture.

nerfstudio turns, centres and scales a capture before it trains on it. ``dataparser_transforms.json`` beside its results
holds ``transform`` [3,4], which moved COLMAP's world, and ``scale``, which then multiplied positions. The
``applied_transform`` and ``applied_scale`` of a transforms.json lead from COLMAP's world to its own. A model of a
capture far from the origin lies around an offset, which a comment names.

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

_IMPLIED: Final = [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]]  # `applied_transform` of versions that did not store it
_NERFSTUDIO: Final = re.compile("nerf?studio", re.IGNORECASE)  # some versions spell it without the f
_OFFSET: Final = re.compile(r"gspure offset (\S+) (\S+) (\S+)")

_LEAST_SHOWN: Final = 0.03  # least share of pixels that show the model; ours
_POINTS: Final = 50_000  # number of random points that estimate this share
_VIEWS: Final = 8  # largest number of views
_SIDE: Final = 32  # longer side of their images, in pixels
_VISIBLE: Final = 1 / 255  # opacity of a row that is seen


def in_world_of(model: Path, cameras: Sequence[Camera], source: Path) -> list[Camera]:
    """Return the cameras of `source` in the world of `model`, a file or folder, with a message if they are moved.

    A list of cameras, such as cameras.json, is already in the world of a model. All else is a capture, which nerfstudio
    moved by the ``dataparser_transforms.json`` beside the model or the cameras. The offset of a model moves cameras
    that are nearer to it than to the origin.
    """
    place = camera_place(source)
    scene = camera_object(source)
    comments = read_model(model).comments if model_file(model).suffix == ".ply" else ()
    if scene or place.is_dir():
        folders = [path if path.is_dir() else path.parent for path in (model, source, place)]
        file = next(filter(Path.is_file, (folder / NORMALIZED for folder in folders)), None)
        if file:
            say(f"{source}: views moved to the world of the model by {file}")
            cameras = _normalized(cameras, Entry(file, "", read_json(file)), scene)
        elif any(_NERFSTUDIO.search(comment) for comment in comments):
            warn(f"{model}: nerfstudio normalizes poses by default: its {NORMALIZED}, put beside, would move {source}")
    centre = np.mean([camera.centre for camera in cameras], axis=0)
    for match in filter(None, map(_OFFSET.fullmatch, comments)):
        offset = np.array(match.groups(), np.float64)
        if np.linalg.norm(centre - offset) < np.linalg.norm(centre):
            say(f"{source}: views moved by {' '.join(map(str, -offset))}, the offset of {model}")
            cameras = shifted(cameras, -offset)
    return [*cameras]


def shifted(cameras: Sequence[Camera], offset: Float64) -> list[Camera]:
    """Return the cameras moved by `offset` [3]."""
    return [camera.moved(rigid(np.eye(3), offset)) for camera in cameras]


def _normalized(cameras: Sequence[Camera], normalization: Entry, scene: Entry | None) -> list[Camera]:
    """Return the cameras with which nerfstudio trained; `scene` is the transforms.json that names them, if any."""
    scale = normalization.positive("scale")
    transform = np.eye(4)
    transform[:3] = normalization.rigid("transform", (3, 4))
    applied = np.eye(4)
    if scene and "applied_transform" in scene:
        applied[:3] = scene.rigid("applied_transform", (3, 4))
    elif scene and (Path(scene.source).parent / "colmap" / "sparse" / "0").exists():
        applied[:3] = _IMPLIED
    if scene and "applied_scale" in scene:
        scale /= scene.positive("applied_scale")
    to_capture = applied @ np.linalg.inv(transform)
    translation_scale = np.ones((4, 4))
    translation_scale[:3, 3] = scale
    return [replace(camera, viewmat=camera.viewmat @ to_capture * translation_scale) for camera in cameras]


def mention_unseen(model: Gaussians, cameras: Sequence[Camera]) -> None:
    """Warn if hardly any pixel of the views shows the model."""
    share = share_shown(model, cameras)
    if share < _LEAST_SHOWN:
        warn(f"about {percent(share)} of the pixels show the model: are these its cameras?")


def share_shown(model: Gaussians, cameras: Sequence[Camera]) -> float:
    """Return the share of the views' pixels that show Gaussians, estimated with random points of some Gaussians."""
    rng = np.random.default_rng(0)
    rows = model[rng.integers(len(model), size=_POINTS)]
    with np.errstate(invalid="ignore", over="ignore"):
        points = rows.means + rng.normal(size=(_POINTS, 3)) * np.median(rows.scales, axis=1, keepdims=True)
    points = points[rows.opacities > _VISIBLE]
    shares = []
    for camera in cameras[:: -(-len(cameras) // _VIEWS)]:
        longer_side = max(camera.width, camera.height)
        width = max(1, camera.width * _SIDE // longer_side)
        height = max(1, camera.height * _SIDE // longer_side)
        _, positions = points_shown(camera.resized(width, height), points)
        columns, rows_of_pixels = positions[:, :2].astype(int).T
        is_shown = np.zeros((width, height), bool)
        is_shown[columns, rows_of_pixels] = True
        shares.append(is_shown.mean())
    return float(np.mean(shares))
