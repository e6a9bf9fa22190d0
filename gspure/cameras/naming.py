"""Names of views, which are unique and safe as file names."""

import hashlib
import re
import unicodedata
from collections.abc import Sequence
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import Final

from gspure.cameras.camera import Camera
from gspure.cameras.entry import Entry
from gspure.errors import InputError
from gspure.images import FORMATS

LONGEST_NAME: Final = 120
"""Bytes of a name in UTF-8. File systems take 255 (some 143); stages add a key and temporary files a process number."""

_DIGEST: Final = 16
_PHOTO_SUFFIXES = re.compile(f"( *({'|'.join(map(re.escape, chain(*FORMATS.values())))}))+$", re.IGNORECASE)
_PHOTO_FOLDER = re.compile(r"images(_\d+)?")


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
    return name if len(name.encode()) <= LONGEST_NAME else _cut(name)


def distinct(cameras: Sequence[Camera], source: Path) -> list[Camera]:
    """Return the cameras if there is at least one and no two share a name."""
    if not cameras:
        raise InputError(source, "views", expected="at least one", found="none")
    places: dict[str, int] = {}
    for i, camera in enumerate(cameras):
        if (first := places.setdefault(camera.name, i)) != i:
            found = f"{camera.name!r} for both view {first} and view {i}"
            raise InputError(source, "view names", expected="each name once", found=found)
    return list(cameras)


def _cut(name: str) -> str:
    digest = hashlib.blake2b(name.encode(), digest_size=_DIGEST // 2).hexdigest()
    start = name.encode()[: LONGEST_NAME - _DIGEST - 1].decode(errors="ignore")
    return f"{start}-{digest}"
