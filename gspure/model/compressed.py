"""Compressed ``.ply`` and ``.splat``, and what compressed formats have in common: colours and rotations in few bits.

A compressed ``.ply`` of PlayCanvas has four numbers of 32 bits per Gaussian, relative to the extent of a chunk of 256::

    chunk    min_x, ..., max_scale_z, and usually min_r, ..., max_b: float32
    vertex   packed_position, packed_rotation, packed_scale, packed_color: uint32
    sh       f_rest_0, ...: uint8, with spherical harmonics beyond the zeroth only

A ``.splat`` has 32 bytes per Gaussian, no header and no spherical harmonics beyond the zeroth.

gsply (MIT), an optional package, writes compressed ``.ply`` and SPZ.
"""

from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import UNPACKED_RATIO, UNPACKED_ROOM, Float32, Indices, UInt8, UInt32
from gspure.constants import SH_DC
from gspure.errors import InputError, reading
from gspure.model.gaussians import CERTAIN, COEFFICIENTS, LEAST_OPACITY, Gaussians, finite, logit
from gspure.model.header import Header, require_size, with_comments
from gspure.progress import warn

Bits = tuple[tuple[int, int], ...]  # the lowest bit of each number, and its number of bits

_COLUMNS: Final = 17  # columns of a model without spherical harmonics beyond the zeroth
_OTHERS: Final = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])

PACKAGES: Final = {"gsply": "gspure[compression]"}
PACKED_PLY: Final = ".compressed.ply"

CHUNK: Final = 256  # rows that share a range of values
_THREE: Final = ((21, 11), (11, 10), (0, 11))
_ROTATION: Final = ((20, 10), (10, 10), (0, 10))
_COLOUR: Final = ((24, 8), (16, 8), (8, 8))
_CHUNK_STEPS: Final = np.array([2047, 1023, 2047])  # of a coordinate in a chunk: 11, 10 and 11 bits
_HARMONICS: Final = 8  # range of spherical harmonics, from minus half of it

_ROW: Final = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("quat", "u1", 4)])
_TOLERANCE: Final = 0.1  # of the length of quaternions; that of other content is at random


def read_splat(path: Path) -> Gaussians:
    """Read a ``.splat`` file."""
    with reading(path, "a .splat model"):
        size = path.stat().st_size
        if not size or size % _ROW.itemsize:
            raise ValueError(f"{size} bytes, no rows of {_ROW.itemsize}")
        rows = np.fromfile(path, _ROW)
        quats = (rows["quat"].astype(np.float32) - 128) / 128
        if not np.median(np.abs(np.linalg.norm(quats, axis=1) - 1)) < _TOLERANCE:
            raise ValueError("rotations that are no unit quaternions")
        rgba = rows["rgba"]
        least = np.finfo(np.float32).tiny  # for scales of 0; those below have no logarithm
        scales = np.where(rows["scale"] < 0, np.float32(np.nan), np.maximum(rows["scale"], least))
        return from_bytes(rows["mean"], quats, np.log(scales), rgba[:, 3], (rgba[:, :3] / 255 - 0.5) / SH_DC)


def is_packed(header: Header) -> bool:
    """Return whether a header is that of a compressed ``.ply``."""
    return any(element.name == "vertex" and "packed_position" in element for element in header.content.elements)


def read_packed(path: Path, file: Header) -> Gaussians:
    """Read a compressed ``.ply`` of this header."""
    header = file.content
    with reading(path, "a compressed .ply"):
        require_room(path, path.stat().st_size, header["vertex"].count, COEFFICIENTS[-1] if "sh" in header else 0)
        tables = _tables(path, file)
        chunks, packed = tables["chunk"][np.arange(header["vertex"].count) // CHUNK], tables["vertex"]
        colours = _numbers(packed["packed_color"], _COLOUR)
        if "min_r" in header["chunk"]:
            colours = _placed(chunks, ("r", "g", "b"), colours)
        means = _placed(chunks, ("x", "y", "z"), _numbers(packed["packed_position"], _THREE))
        three = (_numbers(packed["packed_rotation"], _ROTATION) - 0.5) * np.float32(np.sqrt(2))
        quats = smallest_three(three, (packed["packed_rotation"] >> 30).astype(np.intp))
        scales = _placed(chunks, ("scale_x", "scale_y", "scale_z"), _numbers(packed["packed_scale"], _THREE))
        opacities = (packed["packed_color"] & 255).astype(np.uint8)
        sh = _harmonics(tables["sh"]) if "sh" in tables else None
        model = from_bytes(means, quats, scales, opacities, (colours - 0.5) / SH_DC, sh)
        return Gaussians(model.table, file.comments)


def require_room(path: Path, size: int, rows: int, coefficients: int = 0) -> None:
    """Refuse a file without rows, and one whose `size` bytes would unpack to far more, before it is unpacked."""
    if rows < 1:
        raise InputError(path, "rows", expected="at least one", found=str(rows))
    unpacked, most = 4 * rows * (_COLUMNS + 3 * coefficients), max(UNPACKED_ROOM, UNPACKED_RATIO * size)
    if unpacked > most:
        raise InputError(path, "size", expected=f"at most {most} bytes unpacked", found=f"{unpacked} bytes")


def from_bytes(
    means: Any, quats: Any, log_scales: Any, opacities: UInt8, colours: Any, harmonics: Float32 | None = None
) -> Gaussians:
    """Return the model of decoded columns: opacities 0 to 255, zeroth coefficients [K,3] and others [K,S,3]."""
    colours, logits = np.asarray(colours, np.float32)[:, None], logit(opacities / 255, LEAST_OPACITY)
    sh = colours if harmonics is None else np.concatenate([colours, harmonics], 1)
    return Gaussians.from_stored(means=means, quats=quats, log_scales=log_scales, opacity_logits=logits, sh_coeffs=sh)


def smallest_three(three: NDArray[Any], largest: Indices) -> Float32:
    """Return unit quaternions [K,4] from their three smallest components [K,3] and the index [K] of the largest."""
    quats = np.empty((len(three), 4), np.float32)
    np.put_along_axis(quats, _OTHERS[largest], three, 1)
    rest = np.sqrt(np.maximum(0, 1 - np.sum(np.square(three), 1, keepdims=True)))
    np.put_along_axis(quats, largest[:, None], rest, 1)
    return quats


def package(path: Path, name: str) -> Any:
    """Return an optional package, gsply or zstandard, or refuse the file that needs it."""
    try:
        return import_module(name)
    except ImportError as error:
        hint = f"pip install {PACKAGES['gsply']}"
        raise InputError(path, name, expected=f"the package {name}", found=str(error), hint=hint) from None


def write_packed(gsply: Any, path: Path, model: Gaussians) -> None:
    """Write a compressed ``.ply``, with a warning of positions that rows far from each other in space coarsen."""
    warn_of_clipping(model, f_rest_=(-4, 4), scale_=(-20, 20))
    size, starts = float(np.median(model.scales.max(axis=1))), np.arange(0, len(model), CHUNK)
    spans = np.maximum.reduceat(model.means, starts) - np.minimum.reduceat(model.means, starts)
    steps = (spans / _CHUNK_STEPS).max(axis=1)
    if rows := int(np.diff(np.append(starts, len(model)))[steps > size].sum()):
        larger = f"steps of up to {steps.max():.3g}, larger than the median Gaussian ({size:.3g})"
        warn(f"positions of {rows} of {len(model)} rows are rounded to {larger}: {CHUNK} consecutive rows share a box")
    data = gsply.compress_to_bytes(gsply_parts(gsply, model, model.means, model.quats, model.sh_coeffs))
    path.write_bytes(with_comments(data, model.comments))


def warn_of_clipping(model: Gaussians, **ranges: tuple[float, float]) -> None:
    """Warn of rows with values beyond the range of their column, named by its prefix."""
    for prefix, (least, largest) in ranges.items():
        values = model.columns(*model.columns_named(prefix))
        if rows := int(((values < least) | (values > largest)).any(axis=1).sum()):
            limits = f"{least:.3g} to {largest:.3g}"
            warn(f"{prefix}* of {rows} of {len(model)} rows are clipped to the range of the format, {limits}")


def gsply_parts(gsply: Any, model: Gaussians, means: Any, quats: Any, coeffs: Any) -> Any:
    """Return columns [K,...] in the order and units of gsply, with finite numbers in place of infinities."""
    quats = quats / np.maximum(np.linalg.norm(quats, axis=1, keepdims=True), np.finfo(np.float32).tiny)
    opacities = np.clip(model.table["opacity"], -CERTAIN, CERTAIN)
    parts = means, finite(model.log_scales), quats, opacities, coeffs[:, 0], coeffs[:, 1:]
    return gsply.GSData.from_arrays(*parts, format="ply")


def _tables(path: Path, file: Header) -> dict[str, NDArray[np.void]]:
    """Return the rows of each element."""
    header, offset, tables = file.content, file.size, {}
    dtypes = {element.name: np.dtype(element.dtype("<")) for element in header.elements}
    if header.text or header.byte_order != "<":
        raise ValueError("a header that does not say binary_little_endian")
    size = sum(element.count * dtypes[element.name].itemsize for element in header.elements)
    require_size(path, file, size)
    for element in header.elements:
        tables[element.name] = np.fromfile(path, dtypes[element.name], element.count, offset=offset)
        offset += tables[element.name].nbytes
    return tables


def _numbers(packed: UInt32, bits: Bits) -> Float32:
    """Return numbers from 0 to 1, one column for each pair of `bits`."""
    if packed.dtype != np.uint32:
        raise ValueError(f"packed numbers of type {packed.dtype}, not uint32")
    return np.stack([(packed >> at & (1 << count) - 1) / np.float32((1 << count) - 1) for at, count in bits], 1)


def _harmonics(stored: NDArray[np.void]) -> Float32:
    """Return coefficients [K,S,3]: the ends of their range for levels 0 and 255, else the centre of the level."""
    levels = np.stack([stored[f"f_rest_{i}"] for i in range(len(stored.dtype.names or ()))], 1)
    degree = COEFFICIENTS.index(levels.shape[1] // 3)
    levels = levels.reshape(len(stored), 3, COEFFICIENTS[degree]).transpose(0, 2, 1)
    shares = np.where(levels == 0, 0, np.where(levels == 255, 1, (levels + np.float32(0.5)) / 256))
    return np.asarray((shares - 0.5) * _HARMONICS, np.float32)


def _placed(chunks: NDArray[np.void], names: tuple[str, ...], shares: Float32) -> Float32:
    """Return the values that shares from 0 to 1 stand for, in the range of each row's chunk."""
    least, largest = (np.stack([chunks[f"{end}_{name}"] for name in names], 1) for end in ("min", "max"))
    return np.asarray(least * (1 - shares) + largest * shares, np.float32)
