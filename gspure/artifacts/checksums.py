"""Checksums of files: each lies in a record beside its file, ``FILE.json``, and is verified when FILE is read.

Record and file move together when a folder is moved. A file that is copied without its record, or that a user made, has
no checksum and is read as it is. CRC-32 finds corruption, several times faster than digests that withstand forgery.
"""

import hashlib
import json
import os
import reprlib
import zlib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from contextvars import ContextVar
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.errors import InputError, reading

COMMAND: Final[ContextVar[str]] = ContextVar("COMMAND", default="")
"""The command that writes; empty outside of commands."""

Record = dict[str, Any]

_BLOCK = 1 << 20


def digest(*parts: bytes | str | NDArray[Any]) -> str:
    """Return a short hexadecimal digest of bytes, texts and arrays (dtype and shape included)."""
    state = hashlib.blake2b(digest_size=16)
    for part in parts:
        if isinstance(part, np.ndarray):
            state.update(f"{part.dtype.str}{part.shape}".encode())
            state.update(np.ascontiguousarray(part).data)
        else:
            data = part.encode() if isinstance(part, str) else part
            state.update(f"{len(data)}:".encode())
            state.update(data)
    return state.hexdigest()


def file_digest(path: Path) -> str:
    """Return the digest of a file's bytes, which identifies its content."""
    with Path(path).open("rb") as stream:
        return hashlib.file_digest(stream, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def file_checksum(path: Path) -> str:
    """Return the CRC-32 of a file's bytes, as eight hexadecimal digits."""
    checksum, block = 0, bytearray(_BLOCK)
    with Path(path).open("rb", buffering=0) as stream:
        while size := stream.readinto(block):
            checksum = zlib.crc32(memoryview(block)[:size], checksum)
    return f"{checksum:08x}"


def record_file(path: Path) -> Path:
    """Return where the record of a file lies."""
    return Path(f"{path}.json")


def record_of(path: Path) -> Record | None:
    """Return the record of a file, with its name (`artifact`), `bytes`, `crc32` and origin, if known; None without one.

    A symbolic link without one has that of its target. Raise `InputError` if the record is corrupt.
    """
    file = record_file(path)
    if not file.is_file():
        file = record_file(Path(os.path.realpath(path)))
    if not file.is_file():
        return None
    with reading(file, "a checksum, as JSON"):
        record = json.loads(file.read_text(encoding="utf-8"))
    match record:
        case {"artifact": str(), "crc32": str()}:
            if (expected := record.get("record", "")) not in {"", found := record_checksum(record)}:
                raise InputError(file, "record", expected=f"CRC-32 {expected}", found=found)
            return dict(record)
        case {"artifact": _} | {"crc32": _}:
            found = ", ".join(f"{name} {reprlib.repr(record.get(name))}" for name in ("artifact", "crc32"))
            raise InputError(file, "record", expected="two texts, artifact and crc32", found=found)
    return None  # some other JSON file


def read_once(read: Callable[[Path], Record]) -> Callable[[Path], Record]:
    """Let a function of a file read it again only if the file changes."""
    of_state = lru_cache(maxsize=16)(lambda file, *_state: read(file))

    def read_changed(file: Path) -> Record:
        state = file.stat()
        return of_state(file, state.st_ino, state.st_size, state.st_mtime_ns)

    return read_changed


@read_once
def own_record(file: Path) -> Record:
    """Return a record that holds its own checksum, such as that of a folder of images; refuse any other file."""
    with reading(file, "a record with its checksum", "record"):
        record = json.loads(file.read_text(encoding="utf-8"), object_pairs_hook=distinct)
        if isinstance(record, dict) and record.get("record") == record_checksum(record):
            return record
        raise ValueError("a corrupt record")


def distinct(pairs: Iterable[tuple[str, Any]]) -> Record:
    """Return a JSON object, or raise `ValueError` if it repeats a name: JSON parsers keep the last value silently."""
    content: Record = {}
    for name, value in pairs:
        if name in content:
            raise ValueError(f"{name!r} twice in an object")
        content[name] = value
    return content


def with_checksum(record: Mapping[str, Any]) -> Record:
    """Return a record with the command that writes it, and its checksum."""
    record = {**record, **({"command": command} if (command := COMMAND.get()) else {})}
    return {**record, "record": record_checksum(record)}


def record_checksum(record: Mapping[str, Any]) -> str:
    """Return the CRC-32 of all entries of a record but `record`, which holds it."""
    entries = {name: value for name, value in record.items() if name != "record"}
    return f"{zlib.crc32(json.dumps(entries, sort_keys=True).encode()):08x}"


def verify(path: Path) -> None:
    """Check a file against its checksum; a file without one passes.

    Raise `InputError` if the file or its record is corrupt.
    """
    record = record_of(path)
    if record is None or not Path(path).exists():
        return
    with reading(path, "a readable file"):
        found = file_checksum(path)
    if found != record["crc32"]:
        hint = f"corrupt or edited; if edited on purpose, delete {record_file(path).name}"
        raise InputError(path, "content", expected=f"CRC-32 {record['crc32']}", found=found, hint=hint)


def require_size(path: Path) -> None:
    """Check that a file with a record exists and has its size, without reading it; a file without one passes.

    Raise `InputError` if the file is missing, cut or continued, or its record is corrupt.
    """
    record = record_of(path)
    if record is None:
        return
    with reading(path, "the file of its record"):
        size = Path(path).stat().st_size
    if size != record.get("bytes", size):
        raise InputError(path, "content", expected=f"{record['bytes']} bytes", found=f"{size} bytes")


def intact(path: Path) -> bool:
    """Return whether a file is there, has a record of its name, and agrees with its checksum."""
    try:
        verify(path)
        return Path(path).exists() and (record_of(path) or {}).get("artifact") == Path(path).name
    except InputError:
        return False


def forget(path: Path) -> None:
    """Remove the record of a file that is about to be replaced.

    A writer that is killed then leaves a file without checksum, never one with the checksum of another. A file of that
    name that is no record stays.
    """
    with suppress(InputError):
        if record_of(path) is not None:
            record_file(path).unlink(missing_ok=True)
