"""Arrays by their elements, files that are whole or absent, and the provenance of a folder of results."""

import fcntl
import hashlib
import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from gspure.errors import InputError, reading

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
UInt8 = NDArray[np.uint8]
UInt32 = NDArray[np.uint32]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]

Shape = tuple[int | None, ...]  # `None` stands for any length

Kind = tuple[np.dtype[Any] | type, Shape]
"""What an array should be: a dtype, or ``np.integer`` or ``np.str_`` for any of these; and a shape."""

PROVENANCE: Final = "provenance.json"

_TEMPORARY: Final = ".gspure-"

UNPACKED_RATIO: Final = 100
UNPACKED_ROOM: Final = 1 << 26
"""An array in an archive may unpack to this many times the file's size, or to this many bytes, whichever is more."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path`; on success it replaces `path`, on failure it is removed.

    So a reader never sees half a file, and a killed writer leaves the old one in place. The temporary name keeps the
    suffix, since some writers choose their format by it.
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
    for left in folder.glob(f"{_TEMPORARY}*"):  # by a killed process, whose lock the system has freed
        with suppress(OSError), _locked(left):
            shutil.rmtree(left)
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
def _locked(folder: Path) -> Iterator[None]:
    """Lock a folder, or raise OSError if another process has."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def _blaming(path: Path, temporary: Path) -> Iterator[None]:
    """Let an error about `temporary`, or of the file system about no file (a full disk), name `path`."""
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
    """Refuse a folder that cannot be written to, before work whose result would be lost."""
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
    """Read JSON, with or without a byte-order mark, or raise `InputError` with the line at which it goes wrong."""
    with reading(path, "JSON"):
        return json.loads(Path(path).read_text(encoding="utf-8-sig"))


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


def write_provenance(
    folder: Path, command: str, *, inputs: Mapping[str, Path], settings: Mapping[str, Any], run: str = ""
) -> None:
    """Write ``provenance.json`` to a folder of results: version, command, settings, inputs with their SHA-256.

    `run` is the run ID of the embedding that the results belong to: the digest of its public model. By default it is
    that of the first input with one.
    """
    from gspure import __version__

    run = run or next(filter(None, map(run_of, inputs.values())), "")
    known = {
        name: {"path": str(path)} | ({"sha256": file_digest(path)} if Path(path).is_file() else {})
        for name, path in inputs.items()
    }
    record = {"gspure": __version__, "command": command, "settings": dict(settings), "inputs": known}
    write_json(Path(folder) / PROVENANCE, record | ({"run": run} if run else {}))


def run_of(path: Path) -> str:
    """Return the run ID in the provenance of a folder, or of the folder of a file; empty if it names none."""
    folder = Path(path) if Path(path).is_dir() else Path(path).parent
    if not (file := folder / PROVENANCE).is_file():
        return ""
    match read_json(file):
        case {"run": str(run)}:
            return run
    return ""


def save_array(path: Path, array: NDArray[Any]) -> None:
    """Write one array as .npy, whole or not at all, without pickle."""
    if array.dtype.hasobject:
        raise ValueError("an array of objects cannot be saved without pickle")
    array = np.asarray(array, order="C")
    with replacing(path) as temporary, temporary.open("wb") as stream:
        # Not np.save, whose `tofile` drops the reason when a disk is full.
        npy.write_array_header_1_0(stream, npy.header_data_from_array_1_0(array))
        stream.write(array.data)


def save_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays as .npz, whole or not at all, without pickle."""
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


def load_array(path: Path, *, dtype: np.dtype[Any] | type, shape: Shape, least: float = -math.inf) -> NDArray[Any]:
    """Read one .npy array of the `Kind` that `dtype` and `shape` make, whose smallest number may be `least`.

    Raise `InputError` if the file is shorter than its header says, the array is of another kind, or a number in it is
    not finite or below `least`.
    """
    with reading(path, "a .npy array"):
        mapped = npy.open_memmap(path, mode="r")  # allocates nothing, whatever the header says
        _require(mapped, path, "array", (dtype, shape), least)
        return np.array(mapped)


def load_arrays(path: Path, kinds: Mapping[str, Kind], content: str) -> dict[str, NDArray[Any]]:
    """Read some arrays of an .npz archive, which should hold `content`.

    Raise `InputError` if an array is missing, unpacks to too much or is of another kind, or a number in it is not
    finite.
    """
    with reading(path, content), path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
        room = max(UNPACKED_ROOM, UNPACKED_RATIO * Path(path).stat().st_size)
        sizes = {info.filename: info.file_size for info in archive.zip.infolist()}
        for name in kinds:
            if (size := sizes.get(f"{name}.npy")) is None:
                raise InputError(path, name, expected=content, found="no such array")
            if size > room:
                raise InputError(path, name, expected=f"at most {room} bytes", found=f"{size} bytes")
        arrays = {name: np.asarray(archive[name]) for name in kinds}
    for name, array in arrays.items():
        _require(array, path, name, kinds[name])
    return arrays


def _require(array: NDArray[Any], path: Path, field: str, kind: Kind, least: float = -math.inf) -> None:
    """Refuse an array of another kind, or with numbers that are not finite or below `least`."""
    if not _is_of(kind, array.dtype, array.shape):
        raise InputError(path, field, expected=_text(*kind), found=_text(array.dtype, array.shape))
    for name in array.dtype.names or ("",):
        column = array[name] if name else array
        if column.dtype.kind == "f" and not (fits := np.isfinite(column) & (column >= least)).all():
            expected = "finite numbers" if least == -math.inf else f"finite numbers of at least {least:g}"
            first = np.argwhere(~fits)[0]
            found = f"{column[tuple(first)]} in row {first[0] if len(first) else 0}"
            raise InputError(path, field, expected=expected, found=found)


def _is_of(kind: Kind, dtype: np.dtype[Any], shape: tuple[int, ...]) -> bool:
    wanted, lengths = kind
    abstract = wanted in (np.integer, np.str_)
    fits = np.issubdtype(dtype, wanted) if abstract else dtype == np.dtype(wanted)
    of_lengths = all(n >= 0 if length is None else n == length for n, length in zip(shape, lengths, strict=False))
    return bool(fits) and len(shape) == len(lengths) and of_lengths


def _text(dtype: np.dtype[Any] | type, shape: Shape) -> str:
    name = dtype.__name__.rstrip("_") if isinstance(dtype, type) else str(dtype)  # NumPy 1 has bool_
    return f"{name} [{', '.join('any' if n is None else str(n) for n in shape)}]"
