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
from gspure.files import read_bytes
from gspure.model.compressed import (
    from_bytes,
    gsply_model,
    package,
    quats_of_smallest,
    require_harmonics,
    require_room,
    warn_of_clipping,
)
from gspure.model.gaussians import RENDER_MODE, REST_COEFFICIENTS, Gaussians
from gspure.model.header import decoded, encoded
from gspure.progress import warn

# SPZ has y up and z backwards, a rotation by 180 degrees about x. It negates these components:
_MEAN_SIGNS: Final = np.array([1, -1, -1], np.float32)
_QUAT_SIGNS: Final = np.array([1, 1, -1, -1], np.float32)  # of (w, x, y, z)
_SH_REST_SIGNS: Final = np.array([-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1], np.float32)[:, None]

_GZIP: Final = b"\x1f\x8b"
_GZIP_HEADER: Final = 10  # size
_FLAGS: Final = 3  # index of the flags' byte
_COMMENTED: Final = 16  # value of the flags if a comment, which ends with a zero, is the only further field

_HEADER: Final = struct.Struct("<4sIIBBBB")
_PLAIN_HEADER: Final = 32
_EXTENSION: Final = struct.Struct("<II")
_ANTIALIASED: Final = 1  # flag of models trained with antialiasing
_EXTENDED: Final = 2  # flag of files with extensions: records of type, length and payload
_SCALED: Final = 0xADBE0001  # type of the extension that scales spherical harmonics
_AXES: Final = 0xADBE0003  # type of the extension that names the axes
_USUAL_AXES: Final = (b"\0\0\0\0", b"\4\0\0\0")  # none named; right, up, back
_MOST_EXTENSIONS: Final = 1 << 16  # bytes

_COLOUR_SCALE: Final = 0.15
_FRACTION_BITS: Final = 12  # of positions, by default
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
        widths = (9, 1, 3, 3, rotation, 3 * REST_COEFFICIENTS[self.degree])
        return [self.rows * width for width in widths if width]


def read_spz(path: Path) -> Gaussians:
    """Read an ``.spz`` file; one of version 4 needs the package zstandard."""
    with reading(path, "an SPZ model of version 2 to 4"):
        data = read_bytes(path)
        gzipped = data[:2] == _GZIP
        unpack = zlib.decompressobj(31)
        head = unpack.decompress(data, _HEADER.size) if gzipped else data[: _HEADER.size]
        header = _Header(*_HEADER.unpack(head))
        if header.magic != b"NGSP" or header.fraction_bits > 24:
            raise ValueError("no header of SPZ")
        versions = (2, 3) if gzipped else (4,)
        if header.version not in versions:
            hint = "save it as SPZ 3 or as .ply"
            raise InputError(path, "version", expected="2 to 4", found=str(header.version), hint=hint)
        require_harmonics(path, (header.degree + 1) ** 2 - 1)
        require_room(path, len(data), header.rows, REST_COEFFICIENTS[header.degree])
        if gzipped:
            size = sum(header.sizes())
            content = unpack.decompress(unpack.unconsumed_tail, size + _MOST_EXTENSIONS)
            if len(content) < size or not unpack.eof:
                raise ValueError(f"streams of other sizes than its {header.rows} rows")
            body = content[:size]
            extensions = content[size:]
        else:
            body, extensions = _unpacked(path, data, header)
        if header.flags & _EXTENDED:
            _require_usual_values(extensions)
        model = Gaussians(_model(header, np.frombuffer(body, np.uint8)).table, _comments(data) if gzipped else ())
        return model.with_comment(RENDER_MODE + "mip") if header.flags & _ANTIALIASED else model


def _comments(data: bytes) -> tuple[str, ...]:
    """Return the comment lines in the gzip header of a file of version 2 or 3."""
    if data[_FLAGS] != _COMMENTED:
        return ()
    comment = data[_GZIP_HEADER : data.index(b"\0", _GZIP_HEADER)]
    return tuple(map(decoded, comment.split(b"\n")))


def write_spz(gsply: Any, path: Path, model: Gaussians) -> None:
    """Write SPZ 3; if the farthest centre needs more room, positions have fewer digits, with a warning."""
    warn_of_clipping(model, f_dc_=(-10 / 3, 10 / 3), f_rest_=(-1, 1), scale_=(-10, 6))
    sh_coeffs = model.sh_coeffs.copy()
    sh_coeffs[:, 1:] *= _SH_REST_SIGNS[: sh_coeffs.shape[1] - 1]
    turned = gsply_model(gsply, model, model.means * _MEAN_SIGNS, model.quats * _QUAT_SIGNS, sh_coeffs)
    gsply.write_spz(path, turned, fractional_bits=_fraction_bits(path, model))
    path.write_bytes(_with_comments(path.read_bytes(), encoded(model.comments)))


def _with_comments(data: bytes, comments: Sequence[bytes]) -> bytes:
    """Return a file of version 2 or 3 with comment lines and no timestamp; its gzip header has no further fields."""
    comment = b"\n".join(comments).replace(b"\0", b" ") + b"\0" if comments else b""
    flags = bytes([_COMMENTED if comments else 0])
    timestamp = bytes(4)
    return data[:_FLAGS] + flags + timestamp + data[_FLAGS + 5 : _GZIP_HEADER] + comment + data[_GZIP_HEADER:]


def _fraction_bits(path: Path, model: Gaussians) -> int:
    """Return how many fractional bits leave room for the farthest centre; warn if positions become coarser."""
    distances = np.abs(model.means).max(axis=1)
    farthest = float(distances.max())
    size = float(np.median(model.scales.max(axis=1)))
    bits = min(_FRACTION_BITS, math.floor(math.log2(_FIXED_POINT / max(farthest, 1))))
    if bits < 1 or 2.0**-bits > size:
        step = f"{2.0**-bits:.3g}, for coordinates up to {farthest:.3g}"
        hint = "`gspure info` lists far rows; remove them"
        raise InputError(path, "x, y, z", expected=f"steps of at most {size:.3g}", found=step, hint=hint)
    if bits < _FRACTION_BITS:
        far = int((distances > _FIXED_POINT / 2**_FRACTION_BITS).sum())
        text = f"{far} of {len(model)} rows have coordinates beyond ±2048"
        warn(f"{text}, so all positions are rounded to 1/{2**bits}, not to 1/4096")
    return bits


def _require_usual_values(extensions: bytes) -> None:
    """Refuse extensions that change the axes or the scale of values; skip all others."""
    while len(extensions) >= _EXTENSION.size:
        kind, length = _EXTENSION.unpack_from(extensions)
        end = _EXTENSION.size + length
        payload = extensions[_EXTENSION.size : end]
        if kind == _SCALED or (kind == _AXES and payload not in _USUAL_AXES):
            raise ValueError(f"other axes than right, up, back, or scaled colours: extension {kind:#x}")
        extensions = extensions[end:]


def _unpacked(path: Path, data: bytes, header: _Header) -> tuple[bytes, bytes]:
    """Return the streams and the extensions of a file of version 4."""
    zstandard = package(path, "zstandard")
    table = int.from_bytes(data[_HEADER.size : _HEADER.size + 4], "little")
    pairs = np.frombuffer(data, "<u8", 2 * header.streams, max(table, _PLAIN_HEADER)).reshape(-1, 2).tolist()
    start = table + 16 * header.streams
    body = b""
    for (packed, _), size in zip(pairs, header.sizes(), strict=False):
        unpack = zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(data[start : start + packed])
        body += unpack.read(size)
        start += packed
    if len(body) != sum(header.sizes()):
        raise ValueError(f"streams of other sizes than its {header.rows} rows")
    return body, data[_PLAIN_HEADER:table]


def _model(header: _Header, body: UInt8) -> Gaussians:
    streams = (part.reshape(header.rows, -1) for part in np.split(body, np.cumsum(header.sizes())[:-1]))
    positions, opacities, colours, scales, rotations, *harmonics = streams
    sh_rest = np.zeros((header.rows, REST_COEFFICIENTS[header.degree], 3), np.float32)
    if harmonics:
        sh_rest[:] = (harmonics[0].reshape(sh_rest.shape) - np.float32(128)) / 128
    fixed = np.pad(positions.reshape(-1, 3), ((0, 0), (1, 0))).view("<i4").reshape(-1, 3) >> 8  # of 24 bits, signed
    means = np.asarray(fixed / (1 << header.fraction_bits), np.float32)
    return from_bytes(
        means * _MEAN_SIGNS,
        _quats(rotations) * _QUAT_SIGNS,
        scales / 16 - 10,
        opacities[:, 0],
        (colours / 255 - 0.5) / _COLOUR_SCALE,
        sh_rest * _SH_REST_SIGNS[: sh_rest.shape[1]],
    )


def _quats(stored: UInt8) -> Float32:
    """Return quaternions (w, x, y, z), stored as (x, y, z) in 3 bytes (version 2), or as the smallest three in 4."""
    if stored.shape[1] == 3:
        return quats_of_smallest(stored / np.float32(127.5) - 1, np.zeros(len(stored), np.intp))
    bits = np.ascontiguousarray(stored).view("<u4")[:, 0]
    stored_components = np.stack([bits >> shift & 1023 for shift in (20, 10, 0)], 1)
    magnitudes = (stored_components & _STEPS) / np.float32(_STEPS * np.sqrt(2))
    components = np.where(stored_components > _STEPS, -magnitudes, magnitudes)
    return np.roll(quats_of_smallest(components, (bits >> 30).astype(np.intp)), 1, 1)
