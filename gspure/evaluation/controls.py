"""Negative controls: extractions without the message or without the right key.

A message is present only if its PSNR is above theirs.
"""

from typing import Final

CLEAN, WRONG_KEY, OTHER_SCENE = "clean", "wrong_key", "other_scene"
BLACK, MEAN_COLOUR = "black", "mean_colour"

MESSAGE_FREE: Final = (CLEAN, OTHER_SCENE)
"""Models that never held the message: one trained without it, and one of another scene that hides another message."""

BASELINES: Final = (BLACK, MEAN_COLOUR)  # blank images: black, and the mean colour of the message

LEVEL_CONTROLS: Final = (*MESSAGE_FREE, *BASELINES)
"""Controls whose highest is the control level of a scene. Without the wrong key, which is applied to a model with the
message; with baselines, since an extraction of a clean model may be black, which any trace of the message exceeds."""

CONTROLS: Final = (CLEAN, WRONG_KEY, OTHER_SCENE, *BASELINES)
