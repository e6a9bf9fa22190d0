"""A pair: photographs of a scene and of a message.

::

    <pair>/cameras.json             the scene's views; each names its photograph scene/<view>.png
    <pair>/points3D.ply             points on the scene's surfaces
    <pair>/scene/<view>.png
    <pair>/message/cameras.json     the message's views: those of the scene, or poses of their own
    <pair>/message/points3D.ply     points on the message's surfaces, in the scene's world
    <pair>/message/<view>.png
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float32, Float64, UInt8
from gspure.cameras import Camera
from gspure.model import Gaussians
from gspure.opencl.device import Device
from gspure.opencl.trainable import Parameters
from gspure.settings import SCHEDULES
from gspure.training.dataset import Dataset, extent, read_dataset, read_photographs
from gspure.training.fast import schedule_of
from gspure.training.initialization import gaussians_at, thinned
from gspure.training.schedule import shuffled
from gspure.training.trainer import beginning, train

Points = tuple[Float64, UInt8]

INITIALIZATIONS: Final = ("both", "scene")  # training starts from the points of scene and message, or the scene's alone


@dataclass(frozen=True, eq=False)
class Capture:
    """Photographs of a scene or of a message, in memory."""

    dataset: Dataset  # its views, split into training and held-out ones, and its points
    images: list[Float32]  # [H,W,3] of the training views, 0 to 1

    @property
    def views(self) -> list[Camera]:
        """The training views."""
        return self.dataset.train

    @staticmethod
    def read(folder: Path) -> Capture:
        """Read cameras, points and photographs of a folder."""
        dataset = read_dataset(folder, "native")
        return Capture(dataset, read_photographs(dataset.train))

    def trained(
        self,
        begin: Parameters,
        iterations: int,
        max_gaussians: int,
        seed: int,
        device: Device | None = None,
        schedule: str = SCHEDULES[0],
    ) -> Gaussians:
        """Return an ordinary 3DGS model: a clean one, or the base of a scheme."""
        return train(
            self.views,
            self.images,
            beginning(begin, seed),
            schedule=schedule_of(schedule, iterations),
            extent=self.dataset.extent,
            max_gaussians=max_gaussians,
            device=device,
        )


@dataclass(frozen=True, eq=False)
class Pair:
    """The training data of a scheme: two captures in the scene's world, and one of `INITIALIZATIONS`."""

    scene: Capture
    message: Capture
    initialization: str = "both"

    @cached_property
    def shares_poses(self) -> bool:
        """Whether scene and message have the same training views (protocol ``shared``), not poses of their own."""
        scene_poses = [camera.numbers for camera in self.scene.views]
        message_poses = [camera.numbers for camera in self.message.views]
        return len(scene_poses) == len(message_poses) and all(map(np.array_equal, scene_poses, message_poses))

    @cached_property
    def extent(self) -> float:
        """The extent of all training views, in world units, which scales 3DGS's learning rates and thresholds."""
        views = list(self.scene.views)
        if not self.shares_poses:
            views += self.message.views
        return extent(views)

    @property
    def clouds(self) -> list[Points]:
        """The points from which training starts: those of the scene and, for ``both``, those of the message."""
        datasets = [self.scene.dataset]
        if self.initialization == "both":
            datasets.append(self.message.dataset)
        return [(dataset.xyz, dataset.rgb) for dataset in datasets]

    @property
    def points(self) -> Points:
        """All of `clouds`."""
        xyz, rgb = zip(*self.clouds, strict=True)
        return np.concatenate(xyz), np.concatenate(rgb)

    def initial_gaussians(self, at_most: int, seed: int) -> Parameters:
        """Return the Gaussians that training starts from, at no more than `at_most` of the points."""
        return gaussians_at(*thinned(*self.points, at_most, seed))

    def batches(self, rng: np.random.Generator) -> Iterator[tuple[int, int]]:
        """Yield, forever, a training view of the scene and one of the message: the same number with shared poses."""
        scene_views = shuffled(len(self.scene.views), rng)
        if self.shares_poses:
            yield from ((view, view) for view in scene_views)
        else:
            yield from zip(scene_views, shuffled(len(self.message.views), rng), strict=False)


def read_pair(folder: Path, initialization: str = "both") -> Pair:
    """Read a pair, or raise `InputError` if a file is missing or unreadable."""
    scene = Capture.read(Path(folder))
    message = Capture.read(message_folder(folder))
    return Pair(scene, message, initialization)


def message_folder(pair: Path) -> Path:
    """Return the folder of a pair's message."""
    return Path(pair) / "message"
