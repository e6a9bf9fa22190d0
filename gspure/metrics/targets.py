"""Targets: the renders of a model, or readings from its renders or its file, that are compared."""

from typing import Final

SCENE: Final = "scene"  # what everybody sees
MESSAGE: Final = "message"  # the extraction that every scheme of hidden pictures has
ADAPTIVE: Final = "message_adaptive"  # the extraction of an owner who adapts to the attack
BITS: Final = "bits"  # hidden bits, read from renders of the scene
MODEL_BITS: Final = "model_bits"  # hidden bits, read from the rows of the model's file
HIDDEN_BITS: Final = (BITS, MODEL_BITS)


def is_picture(target: str) -> bool:
    """Return whether a target is an extraction that shows the message, not the scene or a detector."""
    return target.startswith(MESSAGE)


def needs_rows(target: str) -> bool:
    """Return whether a target is extracted from the rows of the scheme's format, not from renders of the scene."""
    return is_picture(target) or target == MODEL_BITS
