"""The resolution rule: the size at which views are rendered and compared with photographs."""

import re
from collections.abc import Sequence

from gspure.cameras.camera import Camera
from gspure.cameras.photographs import photograph, photograph_size
from gspure.errors import InputError

TRAINING_RULE = "1600px"  # the default size of training in 3DGS

_RULE = re.compile(r"native|photographs|1/(?P<factor>[1-9]\d{0,4})|(?P<width>[1-9]\d{0,4})px")


def scaled(cameras: Sequence[Camera], rule: str) -> list[Camera]:
    """Return the cameras at another image size, never enlarged.

    The intrinsics are scaled by the exact ratio of the sizes, so the field of view is unchanged. The rules:

    - ``native``: the file's size;
    - ``1/N``: width and height divided by N and rounded, as 3DGS does for ``-r N`` (a half to the even number);
    - ``Wpx``: wider views become W pixels wide, with their height rounded down; ``1600px`` is 3DGS's default;
    - ``photographs``: the size of each view's photograph, if it is smaller than the view.

    Raise `InputError` for another rule, and for a photograph that is needed, but missing or unreadable.
    """
    parsed = _RULE.fullmatch(rule)
    if parsed is None:
        raise InputError(
            "resolution", "value", expected="native, photographs, 1/N or Wpx (such as 1600px)", found=repr(rule)
        )
    if parsed["factor"]:
        factor = int(parsed["factor"])
        return [c.resized(max(1, round(c.width / factor)), max(1, round(c.height / factor))) for c in cameras]
    if parsed["width"]:
        width = int(parsed["width"])
        return [c.resized(width, max(1, c.height * width // c.width)) if c.width > width else c for c in cameras]
    if rule == "photographs":
        sizes = [photograph_size(photograph(camera)) for camera in cameras]
        return [c.resized(min(w, c.width), min(h, c.height)) for c, (w, h) in zip(cameras, sizes, strict=True)]
    return list(cameras)
