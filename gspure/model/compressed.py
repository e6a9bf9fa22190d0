"""Models in compressed formats, which are recognized but not read."""

from __future__ import annotations

from pathlib import Path

from gspure.errors import InputError

CONVERT = "convert it to a plain 3DGS .ply first, for example with PlayCanvas' splat-transform"

_SUFFIXES = (".spz", ".sog", ".splat", ".ksplat")
_SOG_INDICES = {"meta.json": "an unpacked SOG model", "lod-meta.json": "a streamed SOG model"}


def refuse_compressed(path: Path) -> None:
    """Refuse a file or folder whose name is that of a model in a compressed format.

    Raises
    ------
    InputError
        With the format and how to convert it.

    """
    compressed = f"a {path.suffix} file" if path.suffix.lower() in _SUFFIXES else None
    for index, title in _SOG_INDICES.items():
        if path.name == index or (path / index).is_file():
            compressed = title
    if compressed:
        raise InputError(path, "format", expected="a 3DGS .ply", found=compressed, hint=CONVERT)
