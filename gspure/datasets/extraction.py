"""A capture out of its archive: the photographs that papers compare on, and where they were taken from."""

from __future__ import annotations

import shutil
import stat
import zipfile
from pathlib import Path, PurePosixPath

from gspure.artifacts import filling, write_json
from gspure.datasets.archives import Archive
from gspure.errors import InputError, reading

RECORD = "origin.json"
"""Written with the files of a scene: where they came from. A folder that has it is whole."""


def extract(file: Path, archive: Archive, scene: str, folder: Path, *, sha256: str) -> None:
    """Unpack one scene as a COLMAP project, ``images/`` and ``sparse/``, all of it or nothing.

    Parameters
    ----------
    file : Path
        The archive.
    archive : Archive
        What it should hold.
    scene : str
        Which of its scenes.
    folder : Path
        Where to; its other files stay.
    sha256 : str
        The archive's digest, for the record.

    Raises
    ------
    InputError
        The archive is damaged, lacks the scene, or has an entry that would lie outside the scene's folder.

    """
    kept = {archive.photographs[scene]: "images", "sparse": "sparse"}
    with reading(file, "a zip archive"), zipfile.ZipFile(file) as stored:
        members = {entry: _place(entry, archive, scene, file) for entry in stored.infolist() if not entry.is_dir()}
        wanted = {entry: place for entry, place in members.items() if place and place.parts[0] in kept}
        if {place.parts[0] for place in wanted.values()} != kept.keys():
            raise InputError(file, scene, expected=f"photographs in {' and '.join(kept)}", found="none")
        with filling(folder) as whole:
            for entry, place in wanted.items():
                target = whole / kept[place.parts[0]] / place.relative_to(place.parts[0])
                target.parent.mkdir(parents=True, exist_ok=True)
                with stored.open(entry) as source, target.open("wb") as copy:  # checks the CRC-32 at its end
                    shutil.copyfileobj(source, copy)
            origin = {"url": archive.url, "sha256": sha256, "images": archive.photographs[scene]}
            write_json(whole / RECORD, origin)


def _place(entry: zipfile.ZipInfo, archive: Archive, scene: str, file: Path) -> PurePosixPath | None:
    """Return where a file lies below its scene's folder, or nothing if it is another's; refuse what leads out of it."""
    path = PurePosixPath(entry.filename)
    root = PurePosixPath(archive.folder, scene)
    if not path.is_relative_to(root) or path == root:
        return None
    if ".." in path.parts or "\\" in entry.filename or stat.S_ISLNK(entry.external_attr >> 16):
        raise InputError(file, entry.filename, expected="a file below its folder", found="a path or link out of it")
    return path.relative_to(root)
