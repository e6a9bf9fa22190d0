"""Negative controls: what an extractor shows of a model without the message, or without the right key.

A message can only be lost if it stands out from these.
"""

from __future__ import annotations

from typing import Final

CLEAN, WRONG_KEY, OTHER_SCENE = "clean", "wrong_key", "other_scene"
BLACK, MEAN_COLOUR = "black", "mean_colour"

MESSAGE_FREE: Final = (CLEAN, OTHER_SCENE)
"""Models that never held the message: one trained without it, and one of another scene that hides another message."""

BASELINES: Final = (BLACK, MEAN_COLOUR)
"""Content-free baselines: black images, and images of the message's own mean colour."""

FLOOR: Final = (*MESSAGE_FREE, *BASELINES)
"""What the floor of a scene is the highest of. The wrong key does not count: it is applied to a model that holds the
message. Baselines do: an extraction may show black of a clean model, and any trace of the message exceeds that."""

CONTROLS: Final = (CLEAN, WRONG_KEY, OTHER_SCENE, *BASELINES)
