"""Cameras in the world of a model, where that differs from the world of its capture.

Trainers move a capture before they train on it: nerfstudio by the similarity that ``dataparser_transforms.json`` holds,
others by one that its cameras and points determine (`gspure.cameras.normalizations`). Each known similarity is tested
on the model (`gspure.cameras.fitting`), and applied only if it fits better than none.

``dataparser_transforms.json`` holds ``transform`` [3,4], which moved COLMAP's world, and ``scale``, which then
multiplied positions. The ``applied_transform`` and ``applied_scale`` of a transforms.json lead from COLMAP's world to
its own. A model of a capture far from the origin lies around an offset, which a comment names.

Source: https://docs.nerf.studio/quickstart/data_conventions.html.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float64
from gspure.cameras.camera import Camera, rigid
from gspure.cameras.entry import Entry
from gspure.cameras.fitting import (
    Cloud,
    Score,
    best_world,
    score_by_photographs,
    score_by_points,
    score_by_views,
    share_too_near,
)
from gspure.cameras.normalizations import normalizations
from gspure.cameras.points import RANDOM_POINTS, points_place, stored_points
from gspure.cameras.reading import camera_object, camera_place
from gspure.constants import NEAR_PLANE
from gspure.files import read_json
from gspure.model import Gaussians, read_model
from gspure.progress import say, warn
from gspure.text import percent

NORMALIZED: Final = "dataparser_transforms.json"

_IMPLIED: Final = [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]]  # `applied_transform` of versions that did not store it
_NERFSTUDIO: Final = re.compile("nerf?studio", re.IGNORECASE)  # some versions spell it without the f
_OFFSET: Final = re.compile(r"gspure offset (\S+) (\S+) (\S+)")

# Ours:
_LEAST_COVERED: Final = 0.03  # least share of pixels that show the model
_LEAST_SEEN: Final = 0.1  # least share of the model that the views show
_MOST_NEAR: Final = 0.05  # largest share of a view's Gaussians before its near plane


def in_world_of(model: Path, cameras: Sequence[Camera], source: Path) -> list[Camera]:
    """Return the cameras of `source` in the world of `model`, a file or folder, with a message if they are moved.

    Warn if the capture's points and photographs fit the model in no known world, if the views hardly show it, or if
    much of it is before their near planes.
    """
    rows = read_model(model)
    cloud = Cloud(rows)
    xyz, _ = stored_points(source)
    xyz = xyz - _offset(rows, cameras)
    cameras = around_offset(model, cameras, source)
    worlds = {"": np.eye(4), **_stored_worlds(model, source)}
    tests = [*_tests(cloud, cameras, xyz, source)]
    if tests:
        worlds |= normalizations(cameras, xyz)
        choices = (best_world(score, worlds, cloud.changes()) for score in tests)
        choice = next((name for name in choices if name is not None), None)
    else:
        choice = best_world(score_by_views(cloud, cameras), worlds)
    by_nerfstudio = any(map(_NERFSTUDIO.search, rows.comments))
    if choice is None or (by_nerfstudio and not choice and not tests):
        hint = f" nerfstudio's {NORMALIZED}, put beside it, would move them" if by_nerfstudio else ""
        evidence = "nothing shows that they fit" if choice is not None else "its points or photographs do not fit"
        warn(f"{source}: {evidence} {model}: are these its cameras, in its world?{hint}")
    if choice:
        say(f"{source}: views moved to the world of {model} by {choice}")
        cameras = [camera.moved(worlds[choice]) for camera in cameras]
    mention_unseen(cloud, cameras)
    return [*cameras]


def _tests(cloud: Cloud, cameras: Sequence[Camera], xyz: Float64, source: Path) -> Iterator[Score]:
    """Yield the tests that a capture admits. Points that may be random count only if they fit."""
    points = score_by_points(cloud, xyz)
    place = points_place(source)
    may_be_random = place is not None and place.name in RANDOM_POINTS
    if points and not (may_be_random and best_world(points, {"": np.eye(4)}, cloud.changes()) is None):
        yield points
    photographs = score_by_photographs(cloud, cameras)
    if photographs:
        yield photographs


def _offset(model: Gaussians, cameras: Sequence[Camera]) -> Float64:
    """Return the offset [3] that a comment of the model names if the cameras are nearer to it than to the origin."""
    centre = np.mean([camera.centre for camera in cameras], axis=0)
    for match in filter(None, map(_OFFSET.fullmatch, model.comments)):
        offset = np.array(match.groups(), np.float64)
        if np.linalg.norm(centre - offset) < np.linalg.norm(centre):
            return offset
    return np.zeros(3)


def around_offset(model: Path, cameras: Sequence[Camera], source: Path) -> list[Camera]:
    """Return the cameras of `source`, moved if they are not yet around the offset of `model`, a file or folder."""
    offset = _offset(read_model(model), cameras)
    if offset.any():
        say(f"{source}: views moved by {' '.join(map(str, -offset))}, the offset of {model}")
    return shifted(cameras, -offset)


def shifted(cameras: Sequence[Camera], offset: Float64) -> list[Camera]:
    """Return the cameras moved by `offset` [3]."""
    return [camera.moved(rigid(np.eye(3), offset)) for camera in cameras]


def _stored_worlds(model: Path, source: Path) -> dict[str, Float64]:
    """Return the similarity of the ``dataparser_transforms.json`` beside a model or capture, by the name of the file.

    A list of cameras, such as cameras.json, is no capture: nerfstudio moved none.
    """
    place = camera_place(source)
    scene = camera_object(source)
    folders = [path if path.is_dir() else path.parent for path in (model, source, place)]
    file = next(filter(Path.is_file, (folder / NORMALIZED for folder in folders)), None)
    if not file or not (scene or place.is_dir()):
        return {}
    normalization = Entry(file, "", read_json(file))
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
    return {str(file): np.diag([scale, scale, scale, 1.0]) @ transform @ np.linalg.inv(applied)}


def mention_unseen(cloud: Cloud, cameras: Sequence[Camera]) -> None:
    """Warn if the views hardly show the model, or if much of it is before their near planes."""
    covered = cloud.share_covered(cameras)
    seen = cloud.share_seen(cameras)
    if covered < _LEAST_COVERED:
        warn(f"about {percent(covered)} of the pixels show the model: are these its cameras?")
    elif seen < _LEAST_SEEN:
        warn(f"the views show about {percent(seen)} of the model: are these its cameras?")
    mention_near(cloud.points, cameras)


def mention_near(points: Float64, cameras: Sequence[Camera]) -> None:
    """Warn if many of the points [P,3] in a view, of a model or of a capture, lie before its near plane."""
    near = share_too_near(points, cameras)
    if near > _MOST_NEAR:
        reason = f"up to {percent(near)} of the points in a view are nearer than {NEAR_PLANE}, and not drawn"
        warn(f"{reason}: if the scene is small, scale up cameras, and model or points, by the same factor")
