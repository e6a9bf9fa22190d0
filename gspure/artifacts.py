"""Files that are either whole or absent, and digests of what they came from."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.errors import InputError, reading


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path`; on success it replaces `path`, on failure it is removed.

    A reader therefore never sees half a file, and a killed writer leaves the old one in place. The temporary name
    keeps the suffix, since some writers choose their format by it.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        with _blaming(path, temporary):
            yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def _blaming(path: Path, temporary: Path) -> Iterator[None]:
    """Let an error of the file system about `temporary` name `path`, of which the user knows."""
    try:
        yield
    except OSError as error:
        if str(error.filename) == str(temporary):
            error.filename = str(path)
        raise


@contextmanager
def filling(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder inside `folder`; on success its files move into `folder`, on failure they are removed.

    Several files that belong together so appear together or not at all. A folder that cannot be written to is told
    before any work is done.

    Raises
    ------
    OSError
        If `folder` is a file, or cannot be made or written to.

    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    temporary = folder / f".{os.getpid()}"
    try:
        with _blaming(folder, temporary):
            temporary.mkdir()
        yield temporary
        for file in [path for path in temporary.rglob("*") if path.is_file()]:
            target = folder / file.relative_to(temporary)
            target.parent.mkdir(parents=True, exist_ok=True)
            file.replace(target)
        made.clear()
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        for path in made:
            with suppress(OSError):  # something else stands in it by now
                path.rmdir()


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    """Write `value` as indented JSON with sorted keys, whole or not at all."""
    write_text(path, json.dumps(value, indent=2, sort_keys=True) + "\n")


def read_json(path: Path) -> Any:
    """Read JSON, or raise `InputError` with the line at which it goes wrong."""
    with reading(path, "JSON"):
        return json.loads(Path(path).read_text(encoding="utf-8"))


def save_array(path: Path, array: NDArray[Any]) -> None:
    """Write one array as .npy, whole or not at all, without pickle."""
    with replacing(path) as temporary, temporary.open("wb") as stream:  # given a name, numpy may add a suffix to it
        np.save(stream, array, allow_pickle=False)


def save_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays as .npz, whole or not at all, without pickle."""
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


def load_array(path: Path, *, dtype: np.dtype[Any] | type, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Read one .npy array and check its type, its shape (``None`` stands for any length) and that it is finite."""
    with reading(path, "a .npy array"), Path(path).open("rb") as stream:
        array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
    fits = len(array.shape) == len(shape) and all(b in (None, a) for a, b in zip(array.shape, shape, strict=True))
    if array.dtype != np.dtype(dtype) or not fits:
        wanted = f"{np.dtype(dtype)} [{', '.join('any' if n is None else str(n) for n in shape)}]"
        raise InputError(path, "array", expected=wanted, found=f"{array.dtype} {list(array.shape)}")
    if array.dtype.kind == "f" and not (finite := np.isfinite(array)).all():
        found = f"others in {array.size - np.count_nonzero(finite)} of {array.size} places"
        raise InputError(path, "array", expected="finite numbers", found=found)
    return array


def load_arrays(path: Path, names: Iterable[str], content: str) -> dict[str, NDArray[Any]]:
    """Read the named arrays of an .npz archive, which should hold `content`."""
    with (
        reading(path, content),
        Path(path).open("rb") as stream,
        zipfile.ZipFile(stream),  # np.load would take a lone array too
    ):
        stream.seek(0)
        archive = np.load(stream, allow_pickle=False)
        for name in set(names) - set(archive.files):
            raise InputError(path, name, expected=content, found="no such array")
        return {name: archive[name] for name in names}


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


def write_provenance(path: Path, *, inputs: Mapping[str, Path], settings: Mapping[str, Any]) -> None:
    """Write ``<path>.json`` beside an artifact: digests of its inputs, its settings, and the version that made it."""
    from gspure import __version__

    record = {
        "artifact": path.name,
        "digest": file_digest(path),
        "gspure": __version__,
        "inputs": {name: {"file": Path(source).name, "digest": file_digest(source)} for name, source in inputs.items()},
        "settings": dict(settings),
    }
    write_json(path.with_name(path.name + ".json"), record)
