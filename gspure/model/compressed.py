"""Compressed ``.ply`` and ``.splat``, and what compressed formats share: colours and rotations in few bits.

A compressed ``.ply`` of PlayCanvas has four 32-bit numbers per Gaussian, relative to the range of a chunk of 256 rows::

    chunk    min_x, ..., max_scale_z, and usually min_r, ..., max_b: float32
    vertex   packed_position, packed_rotation, packed_scale, packed_color: uint32
    sh       f_rest_0, ...: uint8, with spherical harmonics beyond the zeroth only

A ``.splat`` has 32 bytes per Gaussian, no header and no spherical harmonics beyond the zeroth.

gsply (MIT), an optional package, writes compressed ``.ply`` and SPZ.
"""

import math
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import UNPACKED_RATIO, UNPACKED_ROOM, Float32, Indices, UInt8, UInt32
from gspure.constants import SH_DC
from gspure.errors import InputError, reading
from gspure.files import read_bytes
from gspure.model.gaussians import CERTAIN, LEAST_OPACITY, REST_COEFFICIENTS, Gaussians, finite, logit
from gspure.model.header import Header, require_size, with_comments
from gspure.progress import warn

Bits = tuple[tuple[int, int], ...]  # lowest bit and number of bits of each number

_COLUMNS: Final = 17  # columns of a model without spherical harmonics beyond the zeroth
_SMALLEST: Final = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])  # components, by the index of the largest

PACKAGES: Final = {"gsply": "gspure[compression]"}
PACKED_PLY: Final = ".compressed.ply"

CHUNK: Final = 256  # rows that share a range of values
_POSITION_BITS: Final = ((21, 11), (11, 10), (0, 11))
_SCALE_BITS: Final = _POSITION_BITS
_ROTATION_BITS: Final = ((20, 10), (10, 10), (0, 10))
_COLOUR_BITS: Final = ((24, 8), (16, 8), (8, 8))
_CHUNK_STEPS: Final = np.array([2047, 1023, 2047])  # of a coordinate in a chunk: 11, 10 and 11 bits
_SH_RANGE: Final = 8  # spherical harmonics lie between minus and plus half of it

_ROW: Final = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("quat", "u1", 4)])
_TOLERANCE: Final = 0.1  # of the median length of quaternions, which tells them from other content


def read_splat(path: Path) -> Gaussians:
    """Read a ``.splat`` file."""
    with reading(path, "a .splat model"):
        data = read_bytes(path)
        if not data or len(data) % _ROW.itemsize:
            raise ValueError(f"{len(data)} bytes, no rows of {_ROW.itemsize}")
        rows = np.frombuffer(data, _ROW)
        quats = (rows["quat"].astype(np.float32) - 128) / 128
        if not np.median(np.abs(np.linalg.norm(quats, axis=1) - 1)) < _TOLERANCE:
            raise ValueError("rotations that are no unit quaternions")
        rgba = rows["rgba"]
        least = np.finfo(np.float32).tiny  # in place of 0; scales below 0 have no logarithm
        scales = np.where(rows["scale"] < 0, np.float32(np.nan), np.maximum(rows["scale"], least))
        return from_bytes(rows["mean"], quats, np.log(scales), rgba[:, 3], (rgba[:, :3] / 255 - 0.5) / SH_DC)


def is_packed(header: Header) -> bool:
    """Return whether a ``.ply`` is compressed, by its header."""
    return any(element.name == "vertex" and "packed_position" in element for element in header.content.elements)


def read_packed(path: Path, file: Header) -> Gaussians:
    """Read a compressed ``.ply`` with this header."""
    header = file.content
    with reading(path, "a compressed .ply"):
        count = header["vertex"].count
        require_room(path, len(file.file), count, REST_COEFFICIENTS[-1] if "sh" in header else 0)
        tables = _tables(path, file)
        packed = tables["vertex"]
        chunks = tables["chunk"][np.arange(count) // CHUNK]
        colours = _numbers(packed["packed_color"], _COLOUR_BITS)
        if "min_r" in header["chunk"]:
            colours = _in_range(chunks, ("r", "g", "b"), colours)
        means = _in_range(chunks, ("x", "y", "z"), _numbers(packed["packed_position"], _POSITION_BITS))
        components = (_numbers(packed["packed_rotation"], _ROTATION_BITS) - 0.5) * np.float32(np.sqrt(2))
        quats = quats_of_smallest(components, (packed["packed_rotation"] >> 30).astype(np.intp))
        scale_shares = _numbers(packed["packed_scale"], _SCALE_BITS)
        log_scales = _in_range(chunks, ("scale_x", "scale_y", "scale_z"), scale_shares)
        opacities = (packed["packed_color"] & 255).astype(np.uint8)
        sh_rest = _sh_rest(path, tables["sh"]) if "sh" in tables else None
        model = from_bytes(means, quats, log_scales, opacities, (colours - 0.5) / SH_DC, sh_rest)
        return Gaussians(model.table, file.comments)


def require_room(path: Path, size: int, rows: int, rest_coefficients: int = 0) -> None:
    """Refuse a file without rows, and one whose `size` bytes would unpack to far more, before it is unpacked."""
    if rows < 1:
        raise InputError(path, "rows", expected="at least one", found=str(rows))
    unpacked = 4 * rows * (_COLUMNS + 3 * rest_coefficients)
    most = max(UNPACKED_ROOM, UNPACKED_RATIO * size)
    if unpacked > most:
        raise InputError(path, "size", expected=f"at most {most} bytes unpacked", found=f"{unpacked} bytes")


def require_harmonics(path: Path, count: float) -> int:
    """Return the SH degree with `count` coefficients beyond the zeroth, or refuse the file; it may be 0 to 3."""
    if count in REST_COEFFICIENTS:
        return REST_COEFFICIENTS.index(int(count))
    degree = math.sqrt(count + 1) - 1
    stored = f"{3 * count:g}, SH degree {degree:g}" if degree.is_integer() else f"{3 * count:g}"
    hint = "train it, or save it again, with SH degree 3"
    raise InputError(path, "f_rest_*", expected="0, 9, 24 or 45 (SH degree 0 to 3)", found=stored, hint=hint)


def from_bytes(
    means: Any, quats: Any, log_scales: Any, opacities: UInt8, sh_dc: Any, sh_rest: Float32 | None = None
) -> Gaussians:
    """Return the model of decoded columns: opacities 0 to 255, zeroth coefficients [K,3] and higher ones [K,S,3]."""
    sh_coeffs = np.asarray(sh_dc, np.float32)[:, None]
    if sh_rest is not None:
        sh_coeffs = np.concatenate([sh_coeffs, sh_rest], 1)
    return Gaussians.from_stored(
        means=means,
        quats=quats,
        log_scales=log_scales,
        opacity_logits=logit(opacities / 255, LEAST_OPACITY),
        sh_coeffs=sh_coeffs,
    )


def quats_of_smallest(components: NDArray[Any], largest: Indices) -> Float32:
    """Return unit quaternions [K,4] from their three smallest components [K,3] and the index [K] of the largest."""
    quats = np.empty((len(components), 4), np.float32)
    np.put_along_axis(quats, _SMALLEST[largest], components, 1)
    largest_components = np.sqrt(np.maximum(0, 1 - np.sum(np.square(components), 1, keepdims=True)))
    np.put_along_axis(quats, largest[:, None], largest_components, 1)
    return quats


def package(path: Path, name: str) -> Any:
    """Return an optional package, gsply or zstandard, or refuse the file that needs it."""
    try:
        return import_module(name)
    except ImportError as error:
        hint = f"pip install '{PACKAGES['gsply']}'"
        raise InputError(path, name, expected=f"the package {name}", found=str(error), hint=hint) from None


def write_packed(gsply: Any, path: Path, model: Gaussians) -> None:
    """Write a compressed ``.ply``; warn if the rows of a chunk lie so far apart that their positions become coarse."""
    warn_of_clipping(model, f_rest_=(-4, 4), scale_=(-20, 20))
    size = float(np.median(model.scales.max(axis=1)))
    starts = np.arange(0, len(model), CHUNK)
    spans = np.maximum.reduceat(model.means, starts) - np.minimum.reduceat(model.means, starts)
    steps = (spans / _CHUNK_STEPS).max(axis=1)
    rows_of_chunks = np.diff(np.append(starts, len(model)))
    coarse = int(rows_of_chunks[steps > size].sum())
    if coarse:
        larger = f"steps of up to {steps.max():.3g}, larger than the median Gaussian ({size:.3g})"
        sharing = f"{CHUNK} consecutive rows share a box"
        warn(f"positions of {coarse} of {len(model)} rows are rounded to {larger}: {sharing}")
    data = gsply.compress_to_bytes(gsply_model(gsply, model, model.means, model.quats, model.sh_coeffs))
    path.write_bytes(with_comments(data, model.comments))


def warn_of_clipping(model: Gaussians, **ranges: tuple[float, float]) -> None:
    """Warn of rows with values outside the range that the format has for their columns, given by prefix."""
    for prefix, (least, largest) in ranges.items():
        values = model.columns(*model.columns_named(prefix))
        clipped = int(((values < least) | (values > largest)).any(axis=1).sum())
        if clipped:
            limits = f"{least:.3g} to {largest:.3g}"
            warn(f"{prefix}* of {clipped} of {len(model)} rows are clipped to the range of the format, {limits}")


def gsply_model(gsply: Any, model: Gaussians, means: Any, quats: Any, sh_coeffs: Any) -> Any:
    """Return gsply's object of parameters [K,...], in its order and units, with finite numbers for infinities."""
    return gsply.GSData.from_arrays(
        means,
        finite(model.log_scales),
        quats / np.maximum(np.linalg.norm(quats, axis=1, keepdims=True), np.finfo(np.float32).tiny),
        np.clip(model.table["opacity"], -CERTAIN, CERTAIN),
        sh_coeffs[:, 0],
        sh_coeffs[:, 1:],
        format="ply",
    )


def _tables(path: Path, file: Header) -> dict[str, NDArray[np.void]]:
    """Return the rows of each element."""
    header = file.content
    dtypes = {element.name: np.dtype(element.dtype("<")) for element in header.elements}
    if header.text or header.byte_order != "<":
        raise ValueError("a header that does not say binary_little_endian")
    size = sum(element.count * dtypes[element.name].itemsize for element in header.elements)
    require_size(path, file, size)
    tables = {}
    offset = file.size
    for element in header.elements:
        tables[element.name] = np.frombuffer(file.file, dtypes[element.name], element.count, offset)
        offset += tables[element.name].nbytes
    return tables


def _numbers(packed: UInt32, bits: Bits) -> Float32:
    """Return numbers from 0 to 1, one column for each pair of `bits`."""
    if packed.dtype != np.uint32:
        raise ValueError(f"packed numbers of type {packed.dtype}, not uint32")
    columns = []
    for lowest_bit, count in bits:
        largest = (1 << count) - 1
        columns.append((packed >> lowest_bit & largest) / np.float32(largest))
    return np.stack(columns, 1)


def _sh_rest(path: Path, stored: NDArray[np.void]) -> Float32:
    """Return coefficients [K,S,3]: the ends of their range for levels 0 and 255, else the centre of the level."""
    levels = np.stack([stored[f"f_rest_{i}"] for i in range(len(stored.dtype.names or ()))], 1)
    degree = require_harmonics(path, levels.shape[1] / 3)
    levels = levels.reshape(len(stored), 3, REST_COEFFICIENTS[degree]).transpose(0, 2, 1)
    shares = np.where(levels == 0, 0, np.where(levels == 255, 1, (levels + np.float32(0.5)) / 256))
    return np.asarray((shares - 0.5) * _SH_RANGE, np.float32)


def _in_range(chunks: NDArray[np.void], names: tuple[str, ...], shares: Float32) -> Float32:
    """Return values from shares, 0 to 1, of the range of each row's chunk."""
    least, largest = (np.stack([chunks[f"{end}_{name}"] for name in names], 1) for end in ("min", "max"))
    return np.asarray(least * (1 - shares) + largest * shares, np.float32)
