"""Targets: the renders of a model, or readings from its renders, that are compared."""

from typing import Final

SCENE: Final = "scene"  # what everybody sees
MESSAGE: Final = "message"  # the extraction that every scheme of hidden pictures has
ADAPTIVE: Final = "message_adaptive"  # the extraction of an owner who adapts to the attack
BITS: Final = "bits"  # hidden bits, read from renders of the scene


def is_picture(target: str) -> bool:
    """Return whether a target is an extraction that shows the message, not the scene or a detector."""
    return target.startswith(MESSAGE)
