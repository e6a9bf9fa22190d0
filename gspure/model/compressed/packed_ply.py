"""Compressed ``.ply`` of PlayCanvas: four numbers of 32 bits per Gaussian, relative to the extent of a chunk of 256.

::

    chunk    min_x, ..., max_scale_z, and usually min_r, ..., max_b: float32
    vertex   packed_position, packed_rotation, packed_scale, packed_color: uint32
    sh       f_rest_0, ...: uint8, with spherical harmonics beyond the zeroth only
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData

from gspure.errors import InputError, reading
from gspure.files import Float32, UInt32
from gspure.model.compressed.quantization import COEFFICIENTS, byte_logits, colour_coeffs, require_room, smallest_three
from gspure.model.gaussians import Gaussians

Bits = tuple[tuple[int, int], ...]  # the lowest bit of each number, and its number of bits

CHUNK: Final = 256  # rows that share a range of values
_THREE: Final = ((21, 11), (11, 10), (0, 11))
_ROTATION: Final = ((20, 10), (10, 10), (0, 10))
_COLOUR: Final = ((24, 8), (16, 8), (8, 8))
_HARMONICS: Final = 8  # range of spherical harmonics, from minus half of it


def is_packed(header: PlyData) -> bool:
    """Return whether a header is that of a compressed ``.ply``."""
    return any(element.name == "vertex" and "packed_position" in element for element in header.elements)


def read_packed(path: Path, header: PlyData, offset: int) -> Gaussians:
    """Read a compressed ``.ply``, whose elements begin after `offset` bytes."""
    with reading(path, "a compressed .ply"):
        size = path.stat().st_size
        rows = int(header["vertex"].count)
        require_room(path, size, rows, COEFFICIENTS[-1] if "sh" in header else 0)
        tables = _tables(path, header, offset)
        chunks, packed = tables["chunk"], tables["vertex"]
        if len(chunks) != -(-rows // CHUNK):
            raise InputError(path, "element chunk", expected=f"{-(-rows // CHUNK)} rows", found=f"{len(chunks)} rows")
        colours = _numbers(packed["packed_color"], _COLOUR)
        if "min_r" in header["chunk"]:
            colours = _placed(chunks, ("r", "g", "b"), colours)
        three = (_numbers(packed["packed_rotation"], _ROTATION) - 0.5) * np.float32(np.sqrt(2))
        model = Gaussians.from_stored(
            means=_placed(chunks, ("x", "y", "z"), _numbers(packed["packed_position"], _THREE)),
            quats=smallest_three(three, (packed["packed_rotation"] >> 30).astype(np.intp)),
            log_scales=_placed(chunks, ("scale_x", "scale_y", "scale_z"), _numbers(packed["packed_scale"], _THREE)),
            opacity_logits=byte_logits((packed["packed_color"] & 255).astype(np.uint8)),
            sh_coeffs=np.concatenate([colour_coeffs(colours)[:, None], _harmonics(path, rows, tables.get("sh"))], 1),
        )
        return Gaussians(model.table, (*header.comments, *header.obj_info))


def _tables(path: Path, header: PlyData, offset: int) -> dict[str, NDArray[np.void]]:
    """Return the rows of each element."""
    if header.text or header.byte_order != "<":
        raise InputError(path, "format", expected="binary_little_endian", found="another")
    dtypes = {element.name: np.dtype(element.dtype("<")) for element in header.elements}
    size = sum(element.count * dtypes[element.name].itemsize for element in header.elements)
    if any(dtype.hasobject for dtype in dtypes.values()) or size != path.stat().st_size - offset:
        raise InputError(path, "file", expected=f"{size} bytes after the header", found="others")
    tables = {}
    for element in header.elements:
        tables[element.name] = np.fromfile(path, dtypes[element.name], element.count, offset=offset)
        offset += tables[element.name].nbytes
    return tables


def _numbers(packed: UInt32, bits: Bits) -> Float32:
    """Return numbers from 0 to 1, one column for each pair of `bits`."""
    if packed.dtype != np.uint32:
        raise ValueError(f"packed numbers of type {packed.dtype}, not uint32")
    return np.stack([(packed >> at & (1 << count) - 1) / np.float32((1 << count) - 1) for at, count in bits], 1)


def _harmonics(path: Path, rows: int, stored: NDArray[np.void] | None) -> Float32:
    """Return coefficients [K,S,3]: the ends of their range for levels 0 and 255, else the centre of the level."""
    if stored is None:
        return np.empty((rows, 0, 3), np.float32)
    names = [f"f_rest_{i}" for i in range(len(stored.dtype.names or ()))]
    if len(stored) != rows or stored.dtype.names != tuple(names) or len(names) // 3 not in COEFFICIENTS:
        expected = f"{rows} rows of f_rest_0 to f_rest_8, 23 or 44"
        raise InputError(path, "element sh", expected=expected, found=f"{len(stored)} rows of {len(names)} properties")
    levels = np.stack([stored[name] for name in names], 1).reshape(rows, 3, -1).transpose(0, 2, 1)
    shares = np.where(levels == 0, 0, np.where(levels == 255, 1, (levels + np.float32(0.5)) / 256))
    return np.asarray((shares - 0.5) * _HARMONICS, np.float32)


def _placed(chunks: NDArray[np.void], names: tuple[str, ...], shares: Float32) -> Float32:
    """Return the values that shares from 0 to 1 stand for, in the range of each row's chunk."""
    chunk = np.arange(len(shares)) // CHUNK
    least, largest = (np.stack([chunks[f"{end}_{name}"] for name in names], 1)[chunk] for end in ("min", "max"))
    return np.asarray(least * (1 - shares) + largest * shares, np.float32)
