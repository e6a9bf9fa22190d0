"""Extraction of a capture from its archive: the photographs that papers evaluate on, and the COLMAP model."""

import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Final

from gspure.artifacts import filling, write_json
from gspure.datasets.archives import Archive
from gspure.errors import InputError, reading

UNPACKED_RATIO: Final = 10
"""An archive may unpack to this many times its size: photographs do not shrink, sparse models to a third. Ours."""

LONGEST_NAME: Final = 255  # bytes of a file's name that file systems take
RECORD = "origin.json"  # where the files of a scene came from; a folder that has it is whole

_CONTENT: Final = "a zip archive"
_PIECE: Final = 1 << 20


def extract(file: Path, archive: Archive, scene: str, folder: Path, *, sha256: str) -> None:
    """Unpack one scene of an archive's `file` as a COLMAP project, ``images/`` and ``sparse/``, all of it or nothing.

    Other files of `folder` stay; `sha256` is the archive's digest, for the record.

    Raise `InputError` if the archive is corrupt or encrypted, lacks the scene, unpacks to more than `UNPACKED_RATIO`
    times its size, or has an entry that would lie outside the scene's folder or whose name does not print.
    """
    kept = {archive.photographs[scene]: "images", "sparse": "sparse"}
    wanted = {entry: place for entry, place in _members(file, archive, scene).items() if place.parts[0] in kept}
    if {place.parts[0] for place in wanted.values()} != kept.keys():
        raise InputError(file, scene, expected=f"photographs in {' and '.join(kept)}", found="none")
    folders = {PurePosixPath(name) for name in kept}.union(*(place.parents for place in wanted.values()))
    for entry, place in wanted.items():
        if place in folders:
            raise InputError(file, entry.filename, expected="a folder", found="a file of that name")
    _require_room(file, sum(entry.file_size for entry in wanted))
    names = {entry: Path(kept[place.parts[0]], *place.parts[1:]) for entry, place in wanted.items()}
    with filling(folder, RECORD, *map(str, names.values())) as whole, zipfile.ZipFile(file) as stored:
        for entry, name in names.items():
            target = whole / name
            target.parent.mkdir(parents=True, exist_ok=True)
            with target.open("wb") as copy:
                copy.writelines(_content(file, stored, entry))
        origin = {"url": archive.url, "sha256": sha256, "images": archive.photographs[scene]}
        write_json(whole / RECORD, origin)


def _members(file: Path, archive: Archive, scene: str) -> dict[zipfile.ZipInfo, PurePosixPath]:
    """Return the files of a scene, and where they lie below its folder."""
    with reading(file, _CONTENT), zipfile.ZipFile(file) as stored:
        places = {entry: _place(entry, archive, scene, file) for entry in stored.infolist() if not entry.is_dir()}
    return {entry: place for entry, place in places.items() if place}


def _content(file: Path, stored: zipfile.ZipFile, entry: zipfile.ZipInfo) -> Iterator[bytes]:
    """Yield a file in pieces; none is longer than it claims, and its CRC-32 is checked at its end."""
    with reading(file, _CONTENT), stored.open(entry) as source:
        while piece := source.read(_PIECE):
            yield piece


def _require_room(file: Path, unpacked: int) -> None:
    """Refuse an archive that claims to unpack to far more than photographs do."""
    most = UNPACKED_RATIO * file.stat().st_size
    if unpacked > most:
        raise InputError(file, "size", expected=f"at most {most} bytes unpacked", found=f"{unpacked} bytes")


def _place(entry: zipfile.ZipInfo, archive: Archive, scene: str, file: Path) -> PurePosixPath | None:
    """Return where a file lies below its scene's folder, or nothing if it is another's; refuse what leads out of it."""
    path = PurePosixPath(entry.filename)
    root = PurePosixPath(archive.folder, scene)
    if not path.is_relative_to(root) or path == root:
        return None
    if ".." in path.parts or "\\" in entry.filename or stat.S_ISLNK(entry.external_attr >> 16):
        raise InputError(file, entry.filename, expected="a file below its folder", found="a path or link out of it")
    if not entry.filename.isprintable() or max(len(part.encode()) for part in path.parts) > LONGEST_NAME:
        expected = f"printable names of at most {LONGEST_NAME} bytes"
        raise InputError(file, entry.filename, expected=expected, found="others")
    return path.relative_to(root)
