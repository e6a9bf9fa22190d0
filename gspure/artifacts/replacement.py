"""The rule for files that exist: a command replaces those that the user names as outputs, and its earlier results.

All else that a command writes, in a folder or beside a named file, replaces nothing but its results, and it deletes
nothing but them. A file is a result of a command if the record of the file, or of its folder of images, or the file
itself, if it is a record, holds its checksum and names no other command; or, corrupt or not, if its name ends with the
digest of what it was made from, as that of a stage, and it has a record.
"""

import os
import re
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Final

from gspure.artifacts.checksums import COMMAND, file_checksum, forget, own_record, record_of
from gspure.errors import InputError

RENDERED: Final = "rendered.json"  # record of the images that a folder has to hold, and of how they were rendered

_KEYED: Final = re.compile(r"\.[0-9a-f]{32}\.(npy|part)$")
_WRITABLE: Final = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH

_named: ContextVar[frozenset[Path] | None] = ContextVar("_named", default=None)
"""The outputs that the user of a command named; None in jobs of the workflow and outside of commands."""


@contextmanager
def replacing_only(command: str, named: Iterable[Path] | None) -> Iterator[None]:
    """Let the block replace only results of a command, the `named` files, and those of an outer block; all if None."""
    places = None if named is None else frozenset({*map(place, named), *(_named.get() or ())})
    tokens = COMMAND.set(command), _named.set(places)
    try:
        yield
    finally:
        COMMAND.reset(tokens[0])
        _named.reset(tokens[1])


def require_replaceable(*paths: Path) -> None:
    """Refuse to replace files that are neither named outputs nor results, read-only files and folders.

    The record of a named output may be that of any command.
    """
    if (named := _named.get()) is None:
        return
    for path in filter(os.path.lexists, paths):
        command = "" if place(path.with_suffix("")) in named else COMMAND.get()
        if path.is_dir():
            expected, found = "a file", "a folder"
        elif path.exists() and not path.stat().st_mode & _WRITABLE:
            expected, found = "a writable file", "a read-only one"
        elif place(path) not in named and not is_result(path, command):
            expected, found = f"a result of an earlier run of `gspure {COMMAND.get()}`", "another file"
        else:
            continue
        raise InputError(path, "output", expected=expected, found=found, hint="name another path, or delete it")


def remove(*paths: Path) -> None:
    """Delete those files that are results, with their records."""
    for path in paths:
        if path.is_file() and is_result(path):
            forget(path)
            path.unlink()


def remove_images(*folders: Path) -> None:
    """Delete the images in folders that are results, their records, and the folders that are empty then."""
    for folder in folders:
        remove(*folder.glob("*.png"), folder / RENDERED)
        with suppress(OSError):  # another file is in it, or there is none
            folder.rmdir()


def is_result(path: Path, command: str | None = None) -> bool:
    """Return whether a file is a result of a command, unchanged and under its name: by default, of the current command.

    The empty command is any. A copy under another name is the user's, even with its record.
    """
    command = COMMAND.get() if command is None else command
    if not path.is_file():
        return False
    with suppress(InputError, OSError, RecursionError, TypeError, ValueError):
        if _KEYED.search(path.name):
            return path.suffix == ".part" or record_of(path) is not None
        if (record := record_of(path)) is not None:
            checksum = record["crc32"] if record["artifact"] == path.name else None
        elif path.suffix == ".png":
            record = own_record(path.with_name(RENDERED))
            checksum = dict(record.get("crc32", {})).get(path.stem)
        elif path.suffix == ".json":
            return command in {"", own_record(path).get("command", command)}
        else:
            return False
        return command in {"", record.get("command", command)} and checksum == file_checksum(path)
    return False


def place(path: Path) -> Path:
    """Return a path with the links of its folders resolved, but not its own: its place tells what a file is for."""
    return path.parent.resolve() / path.name
