"""Ray-traced pairs: a scene and a message by name, and how the message stands relative to the scene."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from gspure.files import Float64
from gspure.scenes.lighting import LitScene, bake
from gspure.scenes.procedural import PROCEDURAL
from gspure.scenes.rooms import PLACEMENTS, Placement, room, vault
from gspure.scenes.scene import Scene
from gspure.settings import SEED

BuildScene = Callable[[Placement], Scene]

NAMES: Final = "room, vault, interior-SEED, landscape-SEED, object-SEED"  # of ray-traced scenes; SEED is a number
PROTOCOLS: Final = ("shared", "own")  # poses of the message's views: those of the scene, or poses of their own

OWN_SHIFT: Final = -2.0
"""Metres by which a message at poses of its own moves along y, after half a turn about the vertical. About two thirds
of its surface points then lie outside all views of the scene. Ours."""


def scene_builder(name: str) -> BuildScene | None:
    """Return the builder of a ray-traced scene; None if no such scene has this name."""
    kind, _, seed = name.partition("-")
    number = SEED.parse(seed)
    if kind in PROCEDURAL and number is not None and seed == str(number):
        return PROCEDURAL[kind](int(number))
    return {"room": room, "vault": vault}.get(name)


@dataclass(frozen=True)
class Staging:
    """A scene and a message of `NAMES`, the `PLACEMENTS` of the message's surfaces, and one of `PROTOCOLS`."""

    scene: str
    message: str
    placement: str
    protocol: str = "shared"

    def lit_scene(self) -> LitScene:
        """Return the scene with its light."""
        return self._lit(self.scene, "coincident")

    def lit_message(self) -> LitScene:
        """Return the message with its light, before `message_transform`."""
        return self._lit(self.message, self.placement)

    @property
    def message_transform(self) -> Float64:
        """The rigid transform [4,4] of the message and its cameras into the scene's world."""
        transform = np.eye(4)
        if self.protocol == "own":
            transform = np.diag([-1.0, -1.0, 1.0, 1.0])
            transform[1, 3] = OWN_SHIFT
        return transform

    @staticmethod
    def _lit(name: str, placement: str) -> LitScene:
        build = scene_builder(name)
        if build is None:
            raise ValueError(f"no ray-traced scene is named {name!r}")
        return bake(build(PLACEMENTS[placement]))
