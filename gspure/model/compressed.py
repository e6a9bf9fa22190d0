"""Models in compressed formats, which are not read but recognized."""

from __future__ import annotations

from pathlib import Path

from gspure.errors import InputError

CONVERT = "convert it to a plain 3DGS .ply first, for example with PlayCanvas' splat-transform"

_SUFFIXES = (".spz", ".sog", ".splat", ".ksplat")
_SOG_INDICES = {"meta.json": "an unpacked SOG model", "lod-meta.json": "a streamed SOG model"}


def refuse_compressed(path: Path) -> None:
    """Refuse a file or folder that, by its name, holds a model in another format than 3DGS PLY.

    Raises
    ------
    InputError
        Saying what it is and how to convert it.

    """
    found = f"a {path.suffix} file" if path.suffix.lower() in _SUFFIXES else None
    for index, title in _SOG_INDICES.items():
        if path.name == index or (path / index).is_file():
            found = title
    if found:
        raise InputError(path, "format", expected="a 3DGS .ply", found=found, hint=CONVERT)
