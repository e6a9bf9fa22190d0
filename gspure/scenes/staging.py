"""What a ray-traced pair shows: two stages, and how the message's stands relative to the scene's."""

from __future__ import annotations

from dataclasses import dataclass

from gspure.scenes.lighting import LitScene, bake
from gspure.scenes.placement import PLACEMENTS
from gspure.scenes.room import room
from gspure.scenes.vault import vault

STAGES = {"room": room, "vault": vault}
"""Procedural scenes by name; each may be the scene or the message."""


@dataclass(frozen=True)
class Staging:
    """A scene and a message.

    Parameters
    ----------
    scene, message : str
        Names in `STAGES`.
    placement : str
        Where the message's stage stands, a name in `gspure.scenes.placement.PLACEMENTS`.

    """

    scene: str
    message: str
    placement: str

    def lit_scene(self) -> LitScene:
        """Return the scene with its light."""
        return bake(STAGES[self.scene](PLACEMENTS["coincident"]))

    def lit_message(self) -> LitScene:
        """Return the message with its light."""
        return bake(STAGES[self.message](PLACEMENTS[self.placement]))
