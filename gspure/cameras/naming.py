"""Names of views: derived from their photographs' file names, safe as file names, unique."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from gspure.cameras.camera import Camera
from gspure.cameras.entry import Entry
from gspure.errors import InputError

_PHOTO_SUFFIXES = frozenset({".bmp", ".exr", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp"})
_PHOTO_FOLDER = re.compile(r"images(_\d+)?")


def view_name(entry: Entry, key: str) -> str:
    """Return the view's name from the file name stored under `key`.

    The suffix of a photograph and the folders up to ``images`` (or ``images_4``, ...) are dropped; other folders are
    joined to the name by ``_``, since two cameras of a rig often name their photographs alike:
    ``images/left/0001.jpg`` becomes ``left_0001``. Outputs are named after the view, so the name never leaves a folder.
    """
    path = PurePosixPath(entry.text(key).replace("\\", "/"))
    if path.suffix.lower() in _PHOTO_SUFFIXES:
        path = path.with_suffix("")
    within = max((i + 1 for i, part in enumerate(path.parts[:-1]) if _PHOTO_FOLDER.fullmatch(part)), default=0)
    name = "_".join(part for part in path.parts[within:] if part not in {"/", ".."})
    if not name or name.startswith(".") or not name.isprintable():
        raise entry.refusal(key, expected="a printable file name", found=repr(entry.text(key)))
    return name


def distinct(cameras: Sequence[Camera], source: Path) -> list[Camera]:
    """Return the cameras if there is one at least and no two share a name."""
    if not cameras:
        raise InputError(source, "views", expected="at least one", found="none")
    places: dict[str, int] = {}
    for i, camera in enumerate(cameras):
        if (first := places.setdefault(camera.name, i)) != i:
            found = f"{camera.name!r} for both view {first} and view {i}"
            raise InputError(source, "view names", expected="each name once", found=found)
    return list(cameras)
