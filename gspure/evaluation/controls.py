"""Negative controls: what an extractor shows where there is no message, or none that its key opens.

A message is only there to be lost if it stands out from these.
"""

from __future__ import annotations

from typing import Final

CLEAN, WRONG_KEY, OTHER_SCENE = "clean", "wrong_key", "other_scene"
BLACK, MEAN_COLOUR = "black", "mean_colour"

MODELS: Final = (CLEAN, WRONG_KEY, OTHER_SCENE)
"""The owner's key on a model that never held a message, a stranger's on the watermarked one, the owner's on another."""

FLOORS: Final = (BLACK, MEAN_COLOUR)
"""Pictures without content: black ones, and ones of the truth's own mean colour."""

CONTROLS: Final = (*MODELS, *FLOORS)
