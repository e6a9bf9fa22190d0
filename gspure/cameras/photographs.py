"""The photographs of views: the names they give, their sizes, missing ones, and the resolution of views."""

import hashlib
import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import Final

from gspure.cameras.camera import Camera
from gspure.cameras.entry import Entry
from gspure.errors import InputError
from gspure.images import FORMATS, opened

TRAINING_RULE: Final = "1600px"  # the default size of training in 3DGS

LONGEST_NAME: Final = 120
"""Bytes of a name in UTF-8. File systems take 255 (some 143); cached views add a key, temporary files a number."""

_DIGEST: Final = 16
_PHOTO_SUFFIXES = re.compile(f"( *({'|'.join(map(re.escape, chain(*FORMATS.values())))}))+$", re.IGNORECASE)
_PHOTO_FOLDER = re.compile(r"images(_\d+)?")
_RULE = re.compile(r"native|photographs|1/(?P<factor>[1-9]\d{0,4})|(?P<width>[1-9]\d{0,4})px")


def view_name(entry: Entry, key: str) -> str:
    """Return the view's name from the file name stored under `key`: `safe_name`, which must not be empty."""
    text = entry.text(key)
    name = safe_name(text)
    if not name:
        raise entry.refusal(key, expected="a file name", found=repr(text))
    return name


def safe_name(text: str) -> str:
    """Return the name of the view whose photograph is `text` in a camera file; empty if it has no usable character.

    Photograph suffixes and the folders up to ``images`` (or ``images_4``, ...) are dropped. Other folders are joined to
    the name by ``_``, since the cameras of a rig often have photographs of the same names: ``images/left/0001.jpg``
    becomes ``left_0001``. Outputs are named after views, so a name is one visible component of a path: separators,
    unprintable characters and leading dots are replaced or dropped, and a name longer than `LONGEST_NAME` is cut and
    gets a digest of the whole. A name maps to itself.
    """
    parts = PurePosixPath(unicodedata.normalize("NFC", text).replace("\\", "/")).parts
    within = max((i + 1 for i, part in enumerate(parts[:-1]) if _PHOTO_FOLDER.fullmatch(part)), default=0)
    joined = "_".join(part for part in parts[within:] if part.strip("/."))
    visible = "".join(c if c.isprintable() else "_" for c in joined).lstrip(". ").rstrip(" ")
    name = _PHOTO_SUFFIXES.sub("", visible)
    if len(name.encode()) <= LONGEST_NAME:
        return name
    digest = hashlib.blake2b(name.encode(), digest_size=_DIGEST // 2).hexdigest()
    return f"{name.encode()[: LONGEST_NAME - _DIGEST - 1].decode(errors='ignore')}-{digest}"


def distinct(cameras: Sequence[Camera], source: Path) -> list[Camera]:
    """Return the cameras if there is at least one and no two share a name."""
    if not cameras:
        raise InputError(source, "views", expected="at least one", found="none")
    counts = Counter(camera.name for camera in cameras)
    name, count = counts.most_common(1)[0]
    if count > 1:
        raise InputError(source, "view names", expected="each name once", found=f"{count} times {name!r}")
    return list(cameras)


def photograph_size(path: Path) -> tuple[int, int]:
    """Return (width, height) of an image file, from its header.

    Raise `InputError` if the file is missing or no image, or has too many pixels.
    """
    with opened(path) as image:
        return image.size


def photograph(camera: Camera) -> Path:
    """Return the file of a view's photograph, or raise `InputError` if the view names none."""
    if camera.image is None:
        raise InputError(camera.name, "image", expected="a photograph", found="none named")
    return camera.image


def missing_photographs(cameras: Sequence[Camera]) -> list[str]:
    """Return the photographs that do not exist, in the order of views; for a view without photograph, its name."""
    missing = (camera for camera in cameras if camera.image is None or not camera.image.is_file())
    return [str(camera.image or f"view {camera.name}") for camera in missing]


def require_present(cameras: Sequence[Camera], source: Path | str, hint: str | None = None) -> None:
    """Require a photograph of every view of `source`, or raise `InputError` with all missing ones."""
    if missing := missing_photographs(cameras):
        found = f"{len(missing)} missing: {', '.join(missing)}"
        raise InputError(source, "photographs", expected=f"one of each of {len(cameras)} views", found=found, hint=hint)


def require_images(cameras: Sequence[Camera], source: Path | str) -> None:
    """Require a photograph of every view of `source`, at least as large as the view.

    Raise `InputError` with all missing photographs, or the first one that is unreadable or smaller than its view.
    """
    require_present(cameras, source)
    for camera in cameras:
        width, height = photograph_size(photograph(camera))
        if width < camera.width or height < camera.height:
            expected = f"a photograph of at least {camera.width}x{camera.height}"
            raise InputError(source, f"{camera.name}.image", expected=expected, found=f"{width}x{height}")


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
        expected = "native, photographs, 1/N or Wpx (such as 1600px)"
        raise InputError("resolution", "value", expected=expected, found=repr(rule))
    factor, most = (int(parsed[name] or 0) for name in ("factor", "width"))

    def size(camera: Camera) -> tuple[int, int]:
        width, height = camera.width, camera.height
        if factor:
            return max(1, round(width / factor)), max(1, round(height / factor))
        if most and width > most:
            return most, max(1, height * most // width)
        if rule == "photographs":
            stored = photograph_size(photograph(camera))
            return min(width, stored[0]), min(height, stored[1])
        return width, height

    return [camera.resized(*size(camera)) for camera in cameras]
