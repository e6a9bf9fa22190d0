"""Arrays: their types by element, and .npy and .npz files without pickle."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from gspure.errors import InputError, reading
from gspure.files import replacing

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
UInt8 = NDArray[np.uint8]
UInt32 = NDArray[np.uint32]
UInt64 = NDArray[np.uint64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]

Shape = tuple[int | None, ...]  # `None` stands for any length

Kind = tuple[np.dtype[Any] | type, Shape]
"""The expected dtype and shape of an array; ``np.integer`` and ``np.str_`` stand for all their dtypes."""

UNPACKED_RATIO: Final = 100
UNPACKED_ROOM: Final = 1 << 26
"""An array in an archive may unpack to `UNPACKED_RATIO` times the file's size or to `UNPACKED_ROOM` bytes."""


def save_array(path: Path, array: NDArray[Any]) -> None:
    """Write one array as .npy, whole or not at all, without pickle."""
    if array.dtype.hasobject:
        raise ValueError("an array of objects cannot be saved without pickle")
    array = np.asarray(array, order="C")
    with replacing(path) as temporary, temporary.open("wb") as stream:
        # The `tofile` of np.save does not say that a disk is full.
        npy.write_array_header_1_0(stream, npy.header_data_from_array_1_0(array))
        stream.write(array.data)


def save_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays as .npz, whole or not at all, without pickle."""
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


def load_array(path: Path, *, dtype: np.dtype[Any] | type, shape: Shape, least: float = -math.inf) -> NDArray[Any]:
    """Read one .npy array.

    Raise `InputError` if the file is shorter than its header says, the array has another dtype or shape, or a number in
    it is not finite or below `least`.
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
            size = sizes.get(f"{name}.npy")
            if size is None:
                raise InputError(path, name, expected=content, found="no such array")
            if size > room:
                raise InputError(path, name, expected=f"at most {room} bytes", found=f"{size} bytes")
        arrays = {name: np.asarray(archive[name]) for name in kinds}
    for name, array in arrays.items():
        _require(array, path, name, kinds[name])
    return arrays


def _require(array: NDArray[Any], path: Path, field: str, kind: Kind, least: float = -math.inf) -> None:
    """Refuse an array of another kind, or with numbers that are not finite or below `least`."""
    expected_dtype, expected_shape = kind
    if not (_has_dtype(array, expected_dtype) and _has_shape(array, expected_shape)):
        raise InputError(path, field, expected=_text(*kind), found=_text(array.dtype, array.shape))
    for name in array.dtype.names or ("",):
        column = array[name] if name else array
        if column.dtype.kind != "f":
            continue
        valid = np.isfinite(column) & (column >= least)
        if not valid.all():
            expected = "finite numbers" if least == -math.inf else f"finite numbers of at least {least:g}"
            first = np.argwhere(~valid)[0]
            value = f"{column[tuple(first)]} in row {first[0] if len(first) else 0}"
            raise InputError(path, field, expected=expected, found=value)


def _has_dtype(array: NDArray[Any], dtype: np.dtype[Any] | type) -> bool:
    if dtype in (np.integer, np.str_):
        return np.issubdtype(array.dtype, dtype)
    return array.dtype == np.dtype(dtype)


def _has_shape(array: NDArray[Any], shape: Shape) -> bool:
    if array.ndim != len(shape):
        return False
    return all(length in (None, actual) for length, actual in zip(shape, array.shape, strict=True))


def _text(dtype: np.dtype[Any] | type, shape: Shape) -> str:
    name = dtype.__name__.rstrip("_") if isinstance(dtype, type) else str(dtype)  # NumPy 1 has bool_
    return f"{name} [{', '.join('any' if length is None else str(length) for length in shape)}]"
