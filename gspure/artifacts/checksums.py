"""Checksums of files: each lies in the provenance beside its file, ``FILE.json``, and is verified when FILE is read.

Provenance and file move together when a folder is moved. A file that is copied without its provenance, or that a user
made, has no checksum and is read as it is.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.errors import InputError, reading


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
    """Return the digest of a file's bytes."""
    with Path(path).open("rb") as stream:
        return hashlib.file_digest(stream, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def provenance_of(path: Path) -> dict[str, Any] | None:
    """Return the provenance of a file (see `gspure.artifacts.write_provenance`), or None if it has none.

    Raises
    ------
    InputError
        If the provenance is damaged.

    """
    file = provenance_file(path)
    if not file.is_file():
        return None
    with reading(file, "provenance, as JSON"):
        record = json.loads(file.read_text(encoding="utf-8"))
    match record:
        case {"artifact": str(), "digest": str(), "inputs": dict(), "settings": dict()}:
            return dict(record)
        case {"artifact": _} | {"digest": _}:
            expected = "artifact, digest, inputs and settings"
            raise InputError(file, "provenance", expected=expected, found=", ".join(record))
    return None


def provenance_file(path: Path) -> Path:
    """Return where the provenance of a file lies."""
    return Path(f"{path}.json")


def verify(path: Path) -> None:
    """Check that a file is what it was when its provenance was written; one without provenance passes.

    Raises
    ------
    InputError
        If the file or its provenance is damaged.

    """
    record = provenance_of(path)
    if record is None or not Path(path).exists():
        return
    with reading(path, "a readable file"):
        found = file_digest(path)
    if found != record["digest"]:
        hint = f"damaged or edited; if edited on purpose, delete {provenance_file(path).name}"
        raise InputError(path, "content", expected=f"digest {record['digest']}", found=f"digest {found}", hint=hint)


def intact(path: Path) -> bool:
    """Return whether a file is there, has a checksum, and agrees with it."""
    try:
        verify(path)
        return Path(path).exists() and provenance_of(path) is not None
    except InputError:
        return False


def forget(path: Path) -> None:
    """Remove the provenance of a file that is about to be replaced.

    A writer that is killed then leaves a file without checksum, never one with the checksum of another. A file of that
    name that is no provenance stays.
    """
    with suppress(InputError):
        if provenance_of(path) is not None:
            provenance_file(path).unlink(missing_ok=True)
