"""The image scale rule: at which size views are rendered and photographs compared."""

from __future__ import annotations

import re
from collections.abc import Sequence

from gspure.cameras.camera import Camera
from gspure.cameras.photographs import photograph, photograph_size
from gspure.errors import InputError

TRAINING_RULE = "1600px"
"""The size at which 3DGS trains unless told otherwise."""

_RULE = re.compile(r"native|photographs|1/(?P<factor>[1-9]\d{0,4})|(?P<width>[1-9]\d{0,4})px")


def scaled(cameras: Sequence[Camera], rule: str) -> list[Camera]:
    """Return the cameras at another image size.

    The intrinsics follow the exact ratio of the two sizes, so the field of view stays what it is.

    Parameters
    ----------
    cameras : sequence of Camera
        Views at their file's size.
    rule : str
        ``native``: the file's size. ``1/N``: width and height divided by N and rounded, as 3DGS does for ``-r N`` (a
        half goes to the even number). ``Wpx``: wider views become W pixels wide, their height is cut to a whole number;
        ``1600px`` is what 3DGS does when no resolution is given. ``photographs``: the size of each view's photograph,
        where that is a reduced copy of what the file describes. Views are never enlarged.

    Raises
    ------
    InputError
        The rule is none of these, or a photograph that it asks for is unknown, missing or no image.

    """
    parsed = _RULE.fullmatch(rule)
    if parsed is None:
        raise InputError(
            "scale rule", "value", expected="native, photographs, 1/N or Wpx (such as 1600px)", found=repr(rule)
        )
    if parsed["factor"]:
        factor = int(parsed["factor"])
        return [c.resized(max(1, round(c.width / factor)), max(1, round(c.height / factor))) for c in cameras]
    if parsed["width"]:
        width = int(parsed["width"])
        return [c.resized(width, max(1, c.height * width // c.width)) if c.width > width else c for c in cameras]
    if rule == "photographs":
        return [_as_photographed(camera) for camera in cameras]
    return list(cameras)


def _as_photographed(camera: Camera) -> Camera:
    width, height = photograph_size(photograph(camera))
    return camera.resized(min(width, camera.width), min(height, camera.height))
