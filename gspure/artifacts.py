"""Files that are either whole or absent, and digests of what they came from."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.errors import InputError


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
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    """Write `value` as indented JSON with sorted keys, whole or not at all."""
    write_text(path, json.dumps(value, indent=2, sort_keys=True) + "\n")


def read_json(path: Path) -> Any:
    """Read JSON, or raise `InputError` with the line at which it goes wrong."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(path, "file", expected="an existing JSON file", found="nothing") from None
    except (OSError, ValueError, RecursionError) as error:  # unreadable, malformed, a number too long, nested too deep
        raise InputError(path, "file", expected="JSON", found=str(error)) from None


def save_array(path: Path, array: NDArray[Any]) -> None:
    """Write one array as .npy, whole or not at all, without pickle."""
    with replacing(path) as temporary:
        np.save(temporary, array, allow_pickle=False)


def load_array(path: Path, *, dtype: np.dtype[Any] | type, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Read one .npy array and check its type and shape (``None`` stands for any length)."""
    try:
        with Path(path).open("rb") as stream:
            array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
    except FileNotFoundError:
        raise InputError(path, "file", expected="an existing .npy file", found="nothing") from None
    except (ValueError, EOFError, OSError) as error:
        raise InputError(path, "file", expected="a .npy array", found=str(error)) from None
    fits = len(array.shape) == len(shape) and all(b in (None, a) for a, b in zip(array.shape, shape, strict=True))
    if array.dtype != np.dtype(dtype) or not fits:
        wanted = f"{np.dtype(dtype)} [{', '.join('any' if n is None else str(n) for n in shape)}]"
        raise InputError(path, "array", expected=wanted, found=f"{array.dtype} {list(array.shape)}")
    return array


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
