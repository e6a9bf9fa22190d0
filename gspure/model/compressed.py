"""Models in compressed formats, which are not read but recognized."""

from __future__ import annotations

from pathlib import Path

from gspure.errors import InputError

CONVERT = "convert it to a plain 3DGS .ply first, for example with PlayCanvas' splat-transform"

_SUFFIXES = (".spz", ".sog", ".splat", ".ksplat")
_SOG_INDEX = "meta.json"


def refuse_compressed(path: Path) -> None:
    """Refuse a file or folder that, by its name, holds a model in another format than 3DGS PLY.

    Raises
    ------
    InputError
        Saying what it is and how to convert it.

    """
    if path.name == _SOG_INDEX or (path / _SOG_INDEX).is_file():
        found = "an unpacked SOG model"
    elif path.suffix.lower() in _SUFFIXES:
        found = f"a {path.suffix} file"
    else:
        return
    raise InputError(path, "format", expected="a 3DGS .ply", found=found, hint=CONVERT)
