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
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float64
from gspure.cameras.camera import Camera, rigid
from gspure.cameras.entry import Entry
from gspure.cameras.fitting import (
    WHOLE,
    Cloud,
    Score,
    best_world,
    contradicts,
    fits,
    score_by_photographs,
    score_by_points,
    score_by_views,
    share_too_near,
    supports,
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

    Warn if the capture's points or photographs do not fit the model there, if nothing tells whether a stored similarity
    applies, if the views hardly show the model, or if much of it is before their near planes.
    """
    rows = read_model(model)
    cloud = Cloud(rows)
    xyz, _ = stored_points(source)
    xyz = xyz - _offset(rows, cameras)
    cameras = around_offset(model, cameras, source)
    worlds = {"": np.eye(4), **_stored_worlds(model, source)}
    by_nerfstudio = any(map(_NERFSTUDIO.search, rows.comments))
    witnesses = _witnesses(cloud, cameras, xyz, source)
    if witnesses:
        worlds |= normalizations(cameras, xyz)
        choice, doubt = _by_witnesses(cloud, witnesses, worlds)
    else:
        choice = _by_views(cloud, cameras, worlds, by_nerfstudio=by_nerfstudio)
        doubt = "nothing shows that its cameras fit" if not choice and (by_nerfstudio or len(worlds) > 1) else ""
    if doubt:
        is_missing = by_nerfstudio and len(worlds) == 1
        hint = f" nerfstudio's {NORMALIZED}, put beside it, would move them" if is_missing else ""
        warn(f"{source}: {doubt} {model}; are these the cameras of the model, in its world?{hint}")
    if choice:
        say(f"{source}: views moved to the world of {model} by {choice}")
        cameras = [camera.moved(worlds[choice]) for camera in cameras]
    mention_unseen(cloud, cameras)
    return [*cameras]


def _witnesses(cloud: Cloud, cameras: Sequence[Camera], xyz: Float64, source: Path) -> dict[str, Score]:
    """Return the tests that a capture admits. Points that may be random count only if they fit."""
    place = points_place(source)
    may_be_random = place is not None and place.name in RANDOM_POINTS
    points = score_by_points(cloud, xyz)
    if points and may_be_random and not supports(points, np.eye(4), cloud):
        points = None
    tests = {"points": points, "photographs": score_by_photographs(cloud, cameras)}
    return {name: test for name, test in tests.items() if test}


def _by_witnesses(cloud: Cloud, witnesses: Mapping[str, Score], worlds: Mapping[str, Float64]) -> tuple[str, str]:
    """Return the world on which the tests that support one agree, and a doubt that names the tests it does not fit."""
    choices = {name: best_world(score, worlds) for name, score in witnesses.items()}
    content = [name for name in witnesses if fits(witnesses[name], worlds[choices[name]], cloud)]
    agreed = {choices[name] for name in content}
    choice = agreed.pop() if len(agreed) == 1 else ""
    others = [name for name in witnesses if name not in content or choices[name] != choice]
    misfits = [name for name in others if not content or contradicts(witnesses[name], worlds[choice], cloud)]
    if misfits == ["points"] and content and witnesses["points"](worlds[choice]) < WHOLE:
        misfits = []  # users cut objects out
    return choice, f"its {' and '.join(misfits)} do not fit" if misfits else ""


def _by_views(cloud: Cloud, cameras: Sequence[Camera], worlds: Mapping[str, Float64], *, by_nerfstudio: bool) -> str:
    """Return the world that the views alone suggest, if nerfstudio made the model or they hardly show it elsewhere."""
    choice = best_world(score_by_views(cloud, cameras), worlds)
    if by_nerfstudio or not choice:
        return choice
    moved = [camera.moved(worlds[choice]) for camera in cameras]
    return choice if _unseen(cloud, cameras) and not _unseen(cloud, moved) else ""


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
    sentence = _unseen(cloud, cameras)
    if sentence:
        warn(f"{sentence}: are these its cameras?")
    mention_near(cloud.points, cameras)


def _unseen(cloud: Cloud, cameras: Sequence[Camera]) -> str:
    """Return a sentence if the views hardly show the model, else nothing."""
    covered = cloud.share_covered(cameras)
    seen = cloud.share_seen(cameras)
    if covered < _LEAST_COVERED:
        return f"about {percent(covered)} of the pixels show the model"
    return f"the views show about {percent(seen)} of the model" if seen < _LEAST_SEEN else ""


def mention_near(points: Float64, cameras: Sequence[Camera]) -> None:
    """Warn if many of the points [P,3] in a view, of a model or of a capture, lie before its near plane."""
    near = share_too_near(points, cameras)
    if near > _MOST_NEAR:
        reason = f"up to {percent(near)} of the points in a view are nearer than {NEAR_PLANE}, and not drawn"
        warn(f"{reason}: if the scene is small, scale up cameras, and model or points, by the same factor")
