"""Output files that are whole or absent, JSON, and digests."""

import fcntl
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from gspure.errors import InputError, reading

Json = dict[str, Any]  # the content of a JSON object

FileState = tuple[int, ...]
_PACKED: Final = {b"\x1f\x8b": "gzip", b"PK\3\4": "zip", b"BZh": "bzip2", b"\xfd7zXZ": "xz", b"(\xb5/\xfd": "zstd"}
"""Compressed files by their first bytes."""

_TEMPORARY: Final = ".gspure-"

_digests_as_read: dict[str, tuple[FileState, str]] = {}
"""State and SHA-256, by absolute path, of the files that this process read."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success its file replaces that of `path`, on failure it is removed.

    So a reader never sees half a file, and a killed writer leaves the old file. The temporary path keeps the suffix,
    since some writers choose their format by it.
    """
    path = Path(path)
    if path.exists() and not path.is_file():  # root could replace /dev/null
        raise InputError(path, "output", expected="a file", found="a folder, a device or a pipe")
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        with _blaming(path, temporary):
            yield temporary
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def filling(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder inside `folder`; on success its files move into `folder`, on failure it is removed.

    So files that belong together appear together or not at all. Files of other names stay.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for leftover in folder.glob(f"{_TEMPORARY}*"):  # of a killed process, whose lock the system has freed
        with suppress(OSError), _locked(leftover):
            shutil.rmtree(leftover)
    temporary = Path(tempfile.mkdtemp(prefix=_TEMPORARY, dir=folder))
    try:
        with _blaming(folder, temporary), ExitStack() as stack:
            with suppress(OSError):  # a file system without locks
                stack.enter_context(_locked(temporary))
            yield temporary
            for file in sorted(path for path in temporary.rglob("*") if path.is_file()):
                target = folder / file.relative_to(temporary)
                target.parent.mkdir(parents=True, exist_ok=True)
                file.replace(target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def filling_alone(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder as `filling` does; refuse a folder that another process fills."""
    with alone_in(folder), filling(folder) as temporary:
        yield temporary


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Raise `InputError` if another process is in this block with the same folder, which is made if it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        try:
            stack.enter_context(_locked(folder))
        except BlockingIOError:
            remedy = "wait for it, or name another folder"
            expected = "no other run here"
            raise InputError(folder, "output", expected=expected, found="one that runs", hint=remedy) from None
        except OSError:
            pass  # a file system without locks
        yield


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock a folder, or raise OSError if another process holds its lock."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def _blaming(path: Path, temporary: Path) -> Iterator[None]:
    """Make errors name `path`: those that name `temporary`, and those of the file system that name no file."""
    try:
        yield
    except InputError as error:
        error.source = error.source.replace(str(temporary), str(path))
        raise
    except OSError as error:
        error.filename = str(error.filename or temporary).replace(str(temporary), str(path))
        error.strerror = error.strerror or str(error)
        raise


def require_writable(folder: Path) -> None:
    """Raise OSError for a folder that cannot be written to, before work is lost."""
    folder.mkdir(parents=True, exist_ok=True)
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        error.filename = str(folder)
        raise


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    """Write `value` as indented JSON with sorted keys, whole or not at all."""
    write_text(path, json.dumps(value, indent=2, sort_keys=True) + "\n")


def read_json(path: Path) -> Any:
    """Read JSON in UTF-8, 16 or 32; raise `InputError` with the line of a syntax error."""
    with reading(path, "JSON"):
        content = read_bytes(path)
        packed = next((name for start, name in _PACKED.items() if content.startswith(start)), None)
        if packed:
            raise InputError(path, "file", expected="JSON", found=f"a {packed} file", hint="unpack it first")
        return json.loads(content.decode("utf-8-sig"))


def read_bytes(path: Path) -> bytes:
    """Return the content of a file; `digest_as_read` then names this content, even if another replaces it."""
    with Path(path).open("rb") as stream:
        return read_all(stream)


def read_all(stream: BinaryIO) -> bytes:
    """Return the content of an open file, as `read_bytes` does.

    It is a copy: a mapped file that another program cuts short would end this process.
    """
    place = os.path.abspath(stream.name)  # noqa: PTH100 -- links stay
    state = file_state(os.fstat(stream.fileno()))
    stream.seek(0)
    content = stream.read()
    known_state, _ = _digests_as_read.get(place, ((), ""))
    if state != known_state:
        _digests_as_read[place] = state, hashlib.sha256(content).hexdigest()
    return content


def file_state(status: os.stat_result) -> FileState:
    """Return what changes with the content of a file: no program can set the time of its last change (ctime)."""
    return status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino


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
    """Return the SHA-256 of a file, in hexadecimal digits."""
    with Path(path).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def digest_as_read(path: Path) -> str:
    """Return the SHA-256 of a file as this process last read it; of one that it did not read, as it is now."""
    _, content_digest = _digests_as_read.get(os.path.abspath(path), ((), ""))  # noqa: PTH100 -- links stay
    return content_digest or file_digest(path)
