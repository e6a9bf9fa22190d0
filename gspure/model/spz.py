"""``.spz``, versions 2 to 4: all positions, then all opacities, colours, scales, rotations and spherical harmonics.

In versions 2 and 3, gzip compresses a header of 16 bytes and these streams together. In version 4, a plain header of 32
bytes and a table of sizes precede the streams, and Zstandard compresses each of them.

The format has no field for a model's comments, so they are in the comment of the gzip header, which readers skip.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from gspure.arrays import Float32, UInt8
from gspure.errors import InputError, reading
from gspure.model.compressed import from_bytes, gsply_parts, package, require_room, smallest_three, warn_of_clipping
from gspure.model.gaussians import COEFFICIENTS, RENDER_MODE, Gaussians
from gspure.model.header import decoded, encoded
from gspure.progress import warn

_TURNED: Final = np.array([1, -1, -1], np.float32)  # SPZ has y up and z backwards: a rotation by 180 degrees about x
_TURNED_QUATS: Final = np.array([1, 1, -1, -1], np.float32)  # the signs of (w, x, y, z), and of degrees 1 to 3
_TURNED_HARMONICS: Final = np.array([-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1], np.float32)[:, None]

_GZIP: Final = b"\x1f\x8b"
_GZIP_HEADER: Final = 10  # size
_FLAGS: Final = 3  # their place
_COMMENTED: Final = 16  # their value if only a comment follows, which ends with a zero

_HEADER: Final = struct.Struct("<4sIIBBBB")
_PLAIN_HEADER: Final = 32
_EXTENSION: Final = struct.Struct("<II")
_ANTIALIASED: Final = 1  # flag of models trained with antialiasing
_EXTENDED: Final = 2  # flag of files with extensions: records of type, length and payload
_SCALED: Final = 0xADBE0001  # type of the extension that scales spherical harmonics
_AXES: Final = 0xADBE0003  # type of the extension that names the axes
_OWN_AXES: Final = (b"\0\0\0\0", b"\4\0\0\0")  # none named, and right, up, back
_MOST_EXTENSIONS: Final = 1 << 16  # bytes

_COLOUR_SCALE: Final = 0.15
_FRACTION_BITS: Final = 12  # of positions, as usual
_FIXED_POINT: Final = (1 << 23) - 1  # the largest number of 24 bits
_STEPS: Final = 511  # largest magnitude of a rotation's component: 9 bits, beside the sign


class _Header(NamedTuple):
    magic: bytes
    version: int
    rows: int
    degree: int
    fraction_bits: int
    flags: int
    streams: int

    def sizes(self) -> list[int]:
        """Return the bytes of each stream."""
        rotation = 4 if self.version > 2 else 3
        return [self.rows * width for width in (9, 1, 3, 3, rotation, 3 * COEFFICIENTS[self.degree]) if width]


def read_spz(path: Path) -> Gaussians:
    """Read an ``.spz`` file; one of version 4 needs the package zstandard."""
    with reading(path, "an SPZ model of version 2 to 4"):
        data = path.read_bytes()
        gzipped = data[:2] == _GZIP
        unpack = zlib.decompressobj(31)
        header = _Header(*_HEADER.unpack(unpack.decompress(data, _HEADER.size) if gzipped else data[: _HEADER.size]))
        is_known = header.magic == b"NGSP" and header.version in ((2, 3) if gzipped else (4,))
        if not is_known or header.degree >= len(COEFFICIENTS) or header.fraction_bits > 24:
            raise ValueError(str(header))
        require_room(path, len(data), header.rows, COEFFICIENTS[header.degree])
        if gzipped:
            size = sum(header.sizes())
            body = unpack.decompress(unpack.unconsumed_tail, size + _MOST_EXTENSIONS)
            if len(body) < size or not unpack.eof:
                raise ValueError(f"streams of other sizes than its {header.rows} rows")
            body, extensions = body[:size], body[size:]
        else:
            body, extensions = _unpacked(path, data, header)
        if header.flags & _EXTENDED:
            _require_usual_values(extensions)
        model = _model(header, np.frombuffer(body, np.uint8))
        end = data.index(b"\0", _GZIP_HEADER) if gzipped and data[_FLAGS] == _COMMENTED else None
        lines = data[_GZIP_HEADER:end].split(b"\n") if end else ()
        commented = Gaussians(model.table, tuple(map(decoded, lines)))
        return commented.with_comment(RENDER_MODE + "mip") if header.flags & _ANTIALIASED else commented


def write_spz(gsply: Any, path: Path, model: Gaussians) -> None:
    """Write SPZ 3; positions have fewer digits, with a warning, if the farthest centre needs more room."""
    warn_of_clipping(model, f_dc_=(-10 / 3, 10 / 3), f_rest_=(-1, 1), scale_=(-10, 6))
    coeffs = model.sh_coeffs.copy()
    coeffs[:, 1:] *= _TURNED_HARMONICS[: coeffs.shape[1] - 1]
    parts = gsply_parts(gsply, model, model.means * _TURNED, model.quats * _TURNED_QUATS, coeffs)
    gsply.write_spz(path, parts, fractional_bits=_fraction_bits(path, model))
    path.write_bytes(_with_comments(path.read_bytes(), encoded(model.comments)))


def _with_comments(data: bytes, comments: Sequence[bytes]) -> bytes:
    """Return a file of version 2 or 3 with comment lines and without a time; its gzip header has no further fields."""
    comment = b"\n".join(comments).replace(b"\0", b" ") + b"\0" if comments else b""
    flags = bytes([_COMMENTED if comments else 0])
    return data[:_FLAGS] + flags + bytes(4) + data[_FLAGS + 5 : _GZIP_HEADER] + comment + data[_GZIP_HEADER:]


def _fraction_bits(path: Path, model: Gaussians) -> int:
    """Return as many fractional bits as leave room for the farthest centre; warn if positions become coarser."""
    distances = np.abs(model.means).max(axis=1)
    farthest, size = float(distances.max()), float(np.median(model.scales.max(axis=1)))
    bits = min(_FRACTION_BITS, math.floor(math.log2(_FIXED_POINT / max(farthest, 1))))
    if bits < 1 or 2.0**-bits > size:
        found = f"{2.0**-bits:.3g}, for coordinates up to {farthest:.3g}"
        hint = "`gspure info` lists far rows; remove them"
        raise InputError(path, "x, y, z", expected=f"steps of at most {size:.3g}", found=found, hint=hint)
    if bits < _FRACTION_BITS:
        far = int((distances > _FIXED_POINT / 2**_FRACTION_BITS).sum())
        text = f"{far} of {len(model)} rows have coordinates beyond ±2048"
        warn(f"{text}, so all positions are rounded to 1/{2**bits}, not to 1/4096")
    return bits


def _require_usual_values(extensions: bytes) -> None:
    """Refuse extensions after which values have other axes or another scale; all others are skipped."""
    while len(extensions) >= _EXTENSION.size:
        kind, length = _EXTENSION.unpack_from(extensions)
        payload, extensions = extensions[_EXTENSION.size :][:length], extensions[_EXTENSION.size + length :]
        if kind == _SCALED or (kind == _AXES and payload not in _OWN_AXES):
            raise ValueError(f"other axes than right, up, back, or scaled colours: extension {kind:#x}")


def _unpacked(path: Path, data: bytes, header: _Header) -> tuple[bytes, bytes]:
    """Return the streams and the extensions of a file of version 4."""
    zstandard = package(path, "zstandard")
    table = int.from_bytes(data[_HEADER.size : _HEADER.size + 4], "little")
    pairs = np.frombuffer(data, "<u8", 2 * header.streams, max(table, _PLAIN_HEADER)).reshape(-1, 2).tolist()
    at, body = table + 16 * header.streams, b""
    for (packed, _), size in zip(pairs, header.sizes(), strict=False):
        unpack = zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(data[at : at + packed])
        body += unpack.read(size)
        at += packed
    if len(body) != sum(header.sizes()):
        raise ValueError(f"streams of other sizes than its {header.rows} rows")
    return body, data[_PLAIN_HEADER:table]


def _model(header: _Header, body: UInt8) -> Gaussians:
    streams = (part.reshape(header.rows, -1) for part in np.split(body, np.cumsum(header.sizes())[:-1]))
    centres, alphas, colours, scales, rotations, *bytes_of_sh = streams
    sh = np.zeros((header.rows, COEFFICIENTS[header.degree], 3), np.float32)
    if bytes_of_sh:
        sh[:] = (bytes_of_sh[0].reshape(sh.shape) - np.float32(128)) / 128
    rgb = (colours / 255 - 0.5) / _COLOUR_SCALE
    fixed = np.pad(centres.reshape(-1, 3), ((0, 0), (1, 0))).view("<i4").reshape(-1, 3) >> 8  # of 24 bits, signed
    means = np.asarray(fixed / (1 << header.fraction_bits), np.float32) * _TURNED
    harmonics = sh * _TURNED_HARMONICS[: sh.shape[1]]
    return from_bytes(means, _quats(rotations) * _TURNED_QUATS, scales / 16 - 10, alphas[:, 0], rgb, harmonics)


def _quats(stored: UInt8) -> Float32:
    """Return quaternions (w, x, y, z), stored as (x, y, z) in 3 bytes (version 2), or as three of four in 4 bytes."""
    if stored.shape[1] == 3:
        return smallest_three(stored / np.float32(127.5) - 1, np.zeros(len(stored), np.intp))
    bits = np.ascontiguousarray(stored).view("<u4")[:, 0]
    components = np.stack([bits >> shift & 1023 for shift in (20, 10, 0)], 1)
    magnitudes = (components & _STEPS) / np.float32(_STEPS * np.sqrt(2))
    three = np.where(components > _STEPS, -magnitudes, magnitudes)
    return np.roll(smallest_three(three, (bits >> 30).astype(np.intp)), 1, 1)
