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

from gspure.cameras.camera import Camera
from gspure.cameras.entry import Entry
from gspure.cameras.reading import camera_object, camera_place
from gspure.constants import NEAR_PLANE
from gspure.files import Float64, read_json
from gspure.model import Gaussians, model_file, read_model
from gspure.progress import percent, say, warn

NORMALIZED: Final = "dataparser_transforms.json"

_IMPLIED: Final = [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]]  # applied by versions that did not write it down
_NERFSTUDIO: Final = re.compile("nerf?studio", re.IGNORECASE)  # some versions spell it without the f
_OFFSET: Final = re.compile(r"gspure offset (\S+) (\S+) (\S+)")

_LEAST_SHOWN: Final = 0.03  # of the pixels show a model, as seldom its cameras do; ours
_VIEWS: Final = 8  # most views, and most rows, by which this share is estimated
_ROWS: Final = 20_000
_SIDE: Final = 32  # of their images, in cells
_REACH: Final = 3  # standard deviations of a Gaussian's middle axis to which a cell shows it
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
            cameras = _normalized(cameras, Entry.of(file, "", read_json(file)), scene)
        elif any(_NERFSTUDIO.search(comment) for comment in comments):
            warn(
                f"{model}: nerfstudio trains in a world of its own, where {source} is only with its {NORMALIZED} beside"
            )
    centre = np.mean([camera.centre for camera in cameras], axis=0)
    for offset in (np.array(match.groups(), np.float64) for text in comments if (match := _OFFSET.fullmatch(text))):
        if np.linalg.norm(centre - offset) < np.linalg.norm(centre):
            say(f"{source}: views moved by {' '.join(map(str, -offset))}, the offset of {model}")
            cameras = shifted(cameras, -offset)
    return [*cameras]


def shifted(cameras: Sequence[Camera], offset: Float64) -> list[Camera]:
    """Return the cameras moved by `offset` [3]."""
    move = np.eye(4)
    move[:3, 3] = -offset
    return [replace(camera, viewmat=camera.viewmat @ move) for camera in cameras]


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
    normalized = [camera.viewmat @ back for camera in cameras]
    for viewmat in normalized:
        viewmat[:3, 3] *= scale
    return [replace(camera, viewmat=viewmat) for camera, viewmat in zip(cameras, normalized, strict=True)]


def mention_unseen(model: Gaussians, cameras: Sequence[Camera]) -> None:
    """Warn if hardly any pixel of the views shows the model."""
    if (share := share_shown(model, cameras)) < _LEAST_SHOWN:
        warn(f"about {percent(share)} of the pixels show the model: are these its cameras?")


def share_shown(model: Gaussians, cameras: Sequence[Camera]) -> float:
    """Return the share of the views' pixels that show Gaussians: an estimate from some rows, some views and cells."""
    rows = model[:: -(-len(model) // _ROWS)]
    with np.errstate(invalid="ignore", over="ignore"):
        reach = _REACH * np.median(rows.scales, axis=1, keepdims=True)
        drawn = np.isfinite(np.hstack([rows.means, reach])).all(axis=1) & (rows.opacities > _LEAST_OPACITY)
    shares = []
    for camera in cameras[:: -(-len(cameras) // _VIEWS)]:
        size = np.maximum(1, np.array([camera.width, camera.height]) * _SIDE // max(camera.width, camera.height))
        small = camera.resized(*size.tolist())
        view = rows.means[drawn] @ small.viewmat[:3, :3].T + small.viewmat[:3, 3]
        shown = view[:, 2] > NEAR_PLANE
        cells = small.K[[0, 1], [0, 1]] / view[shown, 2:]
        centres, radii = cells * view[shown, :2] + small.K[:2, 2], cells * reach[drawn][shown]
        low, high = (
            np.clip(edge, 0, size).astype(int).T for edge in (np.floor(centres - radii), np.ceil(centres + radii))
        )
        corners = np.zeros(size + 1, int)  # of rectangles, whose number at each cell is the sum up to it
        for u, v, sign in ((low[0], low[1], 1), (low[0], high[1], -1), (high[0], low[1], -1), (high[0], high[1], 1)):
            np.add.at(corners, (u, v), sign)
        shares.append((corners.cumsum(axis=0).cumsum(axis=1)[:-1, :-1] > 0).mean())
    return float(np.mean(shares))
