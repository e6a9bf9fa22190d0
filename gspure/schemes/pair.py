"""A pair: photographs of a scene and of a message from the same poses.

::

    <pair>/cameras.json             the views; each names its photograph scene/<view>.png
    <pair>/cameras.json.json        their provenance: what a ray-traced pair shows
    <pair>/points3D.ply             points on the scene's surfaces
    <pair>/scene/<view>.png
    <pair>/message/<view>.png
    <pair>/message/points3D.ply     points on the message's surfaces, in the same world units
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.artifacts.checksums import record_of
from gspure.cameras import Camera
from gspure.errors import InputError
from gspure.evaluation.metrics import psnr
from gspure.images import read_image
from gspure.model.points import read_point_ply
from gspure.scenes import PLACEMENTS, STAGES, Staging
from gspure.training.dataset import Dataset, read_dataset, read_photographs

Float32 = NDArray[np.float32]
Points = tuple[NDArray[np.float64], NDArray[np.uint8]]

PROBES: Final = 2
"""Number of views over which progress reports average the quality."""


@dataclass(frozen=True, eq=False)
class Pair:
    """The training data of a scheme, in memory.

    Parameters
    ----------
    dataset : Dataset
        The scene's views, split into training and held-out ones, and its points.
    scene, message : list of array [H,W,3]
        Photographs of the training views, 0 to 1.
    message_points : (xyz [P,3], rgb [P,3])
        On the message's surfaces; P may be 0.
    probes : list of (Camera, scene, message)
        A few views for progress reports, held-out ones if there are any.
    staging : Staging, optional
        What a ray-traced pair shows; None of photographs.

    """

    dataset: Dataset
    scene: list[Float32]
    message: list[Float32]
    message_points: Points
    probes: list[tuple[Camera, Float32, Float32]]
    staging: Staging | None = None

    @property
    def views(self) -> list[Camera]:
        """The training views."""
        return self.dataset.train

    @property
    def points(self) -> Points:
        """The points of scene and message, from which training starts."""
        xyz, rgb = self.message_points
        return np.concatenate([self.dataset.xyz, xyz]), np.concatenate([self.dataset.rgb, rgb])

    def quality(self, *views: Callable[[Camera], Float32]) -> str:
        """Return the mean PSNR at the probes as text, given renderers of the scene and optionally of the message."""
        means = [
            np.mean([psnr(view(camera).clip(0, 1), truth[i]) for camera, *truth in self.probes])
            for i, view in enumerate(views)
        ]
        return f"PSNR {' / '.join(f'{mean:.2f}' for mean in means)}"


def read_pair(folder: Path, resolution: str = "native") -> Pair:
    """Read a pair; `resolution` is a rule of `gspure.cameras.scaled`.

    Raises
    ------
    InputError
        A file is missing or unreadable, or a view of the message has another shape than that of the scene.

    """
    folder = Path(folder)
    dataset = read_dataset(folder, resolution)
    probes = dataset.test[:PROBES] or dataset.train[:PROBES]
    points = folder / "message" / "points3D.ply"
    return Pair(
        dataset,
        read_photographs(dataset.train),
        _messages(folder, dataset.train),
        read_point_ply(points) if points.is_file() else (np.empty((0, 3)), np.empty((0, 3), np.uint8)),
        list(zip(probes, read_photographs(probes), _messages(folder, probes), strict=True)),
        _staging(folder / "cameras.json"),
    )


def message_view(folder: Path, view: str) -> Path:
    """Return the file of a view of the message."""
    return folder / "message" / f"{view}.png"


def _messages(folder: Path, views: Sequence[Camera]) -> list[Float32]:
    files = [message_view(folder, camera.name) for camera in views]
    for file in files:
        if not file.is_file():
            raise InputError(file, "file", expected="the message at this view", found="nothing")
    return [read_image(f, (c.width, c.height)) for f, c in zip(files, views, strict=True)]


def _staging(cameras: Path) -> Staging | None:
    match (record_of(cameras) or {}).get("settings"):
        case {"scene": str(scene), "message": str(message), "placement": str(placement)}:
            known = {scene, message} <= STAGES.keys() and placement in PLACEMENTS
            return Staging(scene, message, placement) if known else None
    return None
