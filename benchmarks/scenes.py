"""The scenes to measure on, with the goals set for them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import pytest
from room import camera, room

from gspure.cameras.camera import Camera
from gspure.model import Gaussians


@dataclass(frozen=True)
class Scene:
    """A room of `count` Gaussians and the size of its one view; `rounds` is how often to measure.

    Goals: a frame with contributions within `frame_ms` on two cores, blending at `peak_share` of the FMA peak.
    """

    name: str
    count: int
    width: int
    height: int
    rounds: int
    frame_ms: float
    peak_share: float

    @property
    def model(self) -> Gaussians:
        """The Gaussians; made once."""
        return _room(self.count)

    @property
    def camera(self) -> Camera:
        """The view."""
        return camera(self.width, self.height)


SMALL = Scene("100k @960x540", 100_000, 960, 540, rounds=21, frame_ms=20.0, peak_share=0.40)
LARGE = Scene("1M @1600x1063", 1_000_000, 1600, 1063, rounds=11, frame_ms=130.0, peak_share=0.33)


each_scene = pytest.mark.parametrize("scene", [SMALL, LARGE], ids=lambda scene: scene.name)


@cache
def _room(count: int) -> Gaussians:
    return room(count)
