"""Arrays on disk, as .npy and .npz without pickle: checked before anything is allocated for them."""

import math
import os
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from gspure.artifacts.checksums import verify
from gspure.artifacts.files import replacing
from gspure.errors import InputError, reading
from gspure.files import Indices

Shape = tuple[int | None, ...]  # `None` stands for any length

Kind = tuple[np.dtype[Any] | type, Shape]
"""What an array should be: a dtype, or ``np.integer`` or ``np.str_`` for any of these; and a shape."""

UNPACKED_RATIO: Final = 100
UNPACKED_ROOM: Final = 1 << 26
"""An array in an .npz may unpack to this many times the file's size, or to this many bytes, whichever is more. Ours."""

_HEADERS: Final = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_PACKINGS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def save_array(path: Path, array: NDArray[Any], *, checksum: bool = False) -> None:
    """Write one array as .npy, whole or not at all, without pickle; with a checksum beside it, if asked to."""
    if array.dtype.hasobject:
        raise ValueError("an array of objects cannot be saved without pickle")
    array = np.asarray(array, order="C")
    with replacing(path, checksum=checksum) as temporary, temporary.open("wb") as stream:
        # Not np.save, whose `tofile` drops the reason when a disk is full.
        npy.write_array_header_1_0(stream, npy.header_data_from_array_1_0(array))
        stream.write(array.data)


def save_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays as .npz, whole or not at all, without pickle."""
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


def load_array(path: Path, *, dtype: np.dtype[Any] | type, shape: Shape, least: float = -math.inf) -> NDArray[Any]:
    """Read one .npy array of the `Kind` that `dtype` and `shape` make, whose smallest number may be `least`.

    Raise `InputError` if the file is corrupt, its size differs from what its header says, the array is of another kind,
    or a number in it is not finite or below `least`.
    """
    verify(path)
    with reading(path, "a .npy array"), Path(path).open("rb") as stream:
        return _read(stream, os.fstat(stream.fileno()).st_size, path, "array", (dtype, shape), least)


def load_arrays(path: Path, kinds: Mapping[str, Kind], content: str) -> dict[str, NDArray[Any]]:
    """Read some arrays of an .npz archive, which should hold `content`.

    Raise `InputError` if the file is corrupt, an array is missing, unpacks to too much or is of another kind, or a
    number in it is not finite.
    """
    verify(path)
    with reading(path, content), Path(path).open("rb") as stream, zipfile.ZipFile(stream) as archive:
        room = max(UNPACKED_ROOM, UNPACKED_RATIO * os.fstat(stream.fileno()).st_size)
        members = {info.filename: info for info in archive.infolist()}
        arrays = {}
        for name, kind in kinds.items():
            if (info := members.get(f"{name}.npy")) is None:
                raise InputError(path, name, expected=content, found="no such array")
            if info.file_size > room or info.compress_type not in _PACKINGS:
                found = f"{info.file_size} bytes, packed by method {info.compress_type}"
                raise InputError(path, name, expected=f"at most {room} bytes, stored or deflated", found=found)
            with archive.open(info) as member:
                arrays[name] = _read(member, info.file_size, path, name, kind)
        return arrays


def _read(stream: IO[bytes], size: int, path: Path, field: str, kind: Kind, least: float = -math.inf) -> NDArray[Any]:
    """Read one array, which should fill a stream of `size` bytes."""
    version = npy.read_magic(stream)
    if version not in _HEADERS:
        raise InputError(path, field, expected="version 1.0 or 2.0 of .npy", found="version {}.{}".format(*version))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about headers of Python 2
        shape, by_columns, dtype = _HEADERS[version](stream)
    if dtype.hasobject:
        raise InputError(path, field, expected="numbers", found="pickled objects")
    if not _is_of(kind, dtype, shape):
        raise InputError(path, field, expected=_text(*kind), found=_text(dtype, shape))
    count = math.prod(shape)
    if stream.tell() + count * dtype.itemsize != size:
        found = f"{size - stream.tell()} bytes"
        raise InputError(path, field, expected=f"{count * dtype.itemsize} bytes of data", found=found)
    array = np.empty(count, dtype)
    stream.readinto(array.view(np.uint8))  # type: ignore[attr-defined]
    array = array.reshape(shape, order="F" if by_columns else "C")
    if len(bad := _unfit(array, least)):
        expected = "finite numbers" if least == -math.inf else f"finite numbers of at least {least:g}"
        first = f"first {array[tuple(bad[0])]} in row {bad[0, 0]}"
        raise InputError(path, field, expected=expected, found=f"others in {len(bad)} of {count} places, {first}")
    return array


def _is_of(kind: Kind, dtype: np.dtype[Any], shape: tuple[int, ...]) -> bool:
    wanted, lengths = kind
    abstract = wanted in (np.integer, np.str_)
    fits = np.issubdtype(dtype, wanted) if abstract else dtype == np.dtype(wanted)
    of_lengths = all(n >= 0 if length is None else n == length for n, length in zip(shape, lengths, strict=False))
    return bool(fits) and len(shape) == len(lengths) and of_lengths


def _text(dtype: np.dtype[Any] | type, shape: Shape) -> str:
    name = dtype.__name__ if isinstance(dtype, type) else str(dtype)
    return f"{name} [{', '.join('any' if n is None else str(n) for n in shape)}]"


def _unfit(array: NDArray[Any], least: float) -> Indices:
    """Return the places that hold NaN, infinity or less than `least`, in any field of a structured array."""
    columns = [array[name] for name in array.dtype.names] if array.dtype.names else [array]
    bad = np.zeros(array.shape, np.bool_)
    for column in columns:
        if column.dtype.kind == "f":
            bad |= ~(np.isfinite(column) & (column >= least))
    return np.argwhere(bad)
