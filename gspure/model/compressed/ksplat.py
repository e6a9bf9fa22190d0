"""``.ksplat``: sections of Gaussians, whose positions are relative to the centres of buckets if they are compressed.

::

    header        4096 bytes
    per section   1024 bytes
    per section   length of each partly filled bucket, uint32; centre of each bucket, 3 float32; rows
"""

from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.errors import InputError, reading
from gspure.files import Float32, UInt8
from gspure.model.compressed.quantization import COEFFICIENTS, byte_logits, colour_coeffs, positive_log, require_room
from gspure.model.gaussians import Gaussians

_HEADER: Final = np.dtype(
    {
        "names": ["version", "sections", "level", "least", "largest"],
        "formats": ["(2,)u1", "<u4", "<u2", "<f4", "<f4"],
        "offsets": [0, 4, 20, 36, 40],
        "itemsize": 4096,
    }
)
_SECTION: Final = np.dtype(
    {
        "names": ["rows", "stored", "capacity", "buckets", "width", "bytes", "range", "full", "partial", "degree"],
        "formats": ["<u4", "<u4", "<u4", "<u4", "<f4", "<u2", "<u4", "<u4", "<u4", "<u2"],
        "offsets": [0, 4, 8, 12, 16, 20, 24, 32, 36, 40],
        "itemsize": 1024,
    }
)
_TYPES: Final = (("<f4", "<f4", "<f4"), ("<u2", "<f2", "<f2"), ("<u2", "<f2", "u1"))
"""By level of compression: types of positions, of scales and quaternions, and of spherical harmonics."""

_CENTRE: Final = np.dtype(("<f4", 3))
_RANGE: Final = 32767  # range of positions, if a section names none

_LIMITS: Final = ("least", "largest")
_HARMONICS: Final = (-1.5, 1.5)  # limits of spherical harmonics, if the header names none


def read_ksplat(path: Path) -> Gaussians:
    """Read a ``.ksplat`` file, of level 0 to 2."""
    with reading(path, "a .ksplat model"):
        data = np.fromfile(path, np.uint8)
        header = _part(data, 0, _HEADER, 1)[0]
        (major, minor), level = header["version"].tolist(), int(header["level"])
        if major or not minor or level >= len(_TYPES):
            raise InputError(path, "version", expected="0.1, level 0 to 2", found=f"{major}.{minor}, level {level}")
        sections = _part(data, _HEADER.itemsize, _SECTION, int(header["sections"]))
        coefficients = COEFFICIENTS[int(sections["degree"][sections["rows"] > 0].max(initial=0))]
        require_room(path, len(data), int(sections["rows"].sum(dtype=np.int64)), coefficients)
        at, tables = _HEADER.itemsize + int(header["sections"]) * _SECTION.itemsize, []
        for section in sections:
            rows, means, at = _rows(data, at, section, level)
            if not len(rows):
                continue
            colours = colour_coeffs(rows["rgba"][:, None, :3] / 255)
            tables.append(
                Gaussians.from_stored(
                    means=means,
                    quats=rows["quat"],
                    log_scales=positive_log(rows["scale"]),
                    opacity_logits=byte_logits(rows["rgba"][:, 3]),
                    sh_coeffs=np.concatenate([colours, _harmonics(rows["sh"], coefficients, header)], 1),
                ).table
            )
        return Gaussians(np.concatenate(tables))


def _part(data: UInt8, at: int, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
    """Return `count` records at byte `at`; raise `ValueError` if the file ends before."""
    if at + count * dtype.itemsize > len(data):
        raise ValueError(f"{len(data)} bytes, too few for its header")
    return np.frombuffer(data, dtype, count, at)


def _rows(data: UInt8, at: int, section: np.void, level: int) -> tuple[NDArray[np.void], Float32, int]:
    """Return the rows of a section, their positions, and where the section ends."""
    count, stored, capacity, buckets, full, partial = (
        int(section[name]) for name in ("rows", "stored", "capacity", "buckets", "full", "partial")
    )
    position, scale, harmonic = _TYPES[level]
    harmonics = (harmonic, 3 * COEFFICIENTS[int(section["degree"])])
    columns = [("mean", position, 3), ("scale", scale, 3), ("quat", scale, 4), ("rgba", "u1", 4), ("sh", *harmonics)]
    row = np.dtype(columns)
    lengths = _part(data, at, np.dtype("<u4"), partial)
    centres = at + lengths.nbytes
    begin = centres + int(section["bytes"]) * buckets
    rows = _part(data, begin, row, stored)[:count]
    if len(rows) < count:
        raise ValueError(f"a section of {count} rows with room for {stored}")
    end = begin + stored * row.itemsize
    if not (level and count):  # reserved sections hold no row
        return rows, rows["mean"].astype(np.float32), end
    if section["bytes"] != _CENTRE.itemsize:
        raise ValueError(f"buckets of {section['bytes']} bytes, not {_CENTRE.itemsize}")
    if full + partial > buckets or capacity * full + int(lengths.sum(dtype=np.int64)) < count:
        raise ValueError("rows without a bucket")
    ends = capacity * full + np.cumsum(lengths, dtype=np.int64)
    bucket = np.arange(count) // max(capacity, 1)
    bucket = np.where(bucket < full, bucket, full + np.searchsorted(ends, np.arange(count), side="right"))
    middle = _part(data, centres, _CENTRE, buckets)[bucket]
    reach = int(section["range"]) or _RANGE
    offsets = (rows["mean"].astype(np.float64) - reach) * (float(section["width"]) / 2 / reach)
    return rows, np.asarray(offsets + middle, np.float32), end


def _harmonics(stored: NDArray[Any], coefficients: int, header: np.void) -> Float32:
    """Return coefficients [K,S,3], zero where none is stored; the file holds each degree channel by channel."""
    values: Float32 = stored.astype(np.float32)
    if stored.dtype == np.uint8:
        least, largest = (float(header[name]) or limit for name, limit in zip(_LIMITS, _HARMONICS, strict=True))
        values = np.float32(least) + values * np.float32((largest - least) / 255)
    padded = np.zeros((len(values), coefficients, 3), np.float32)
    for before, after in pairwise(n for n in COEFFICIENTS if 3 * n <= stored.shape[1]):
        band = values[:, 3 * before : 3 * after].reshape(len(values), 3, after - before)
        padded[:, before:after] = band.transpose(0, 2, 1)
    return padded
