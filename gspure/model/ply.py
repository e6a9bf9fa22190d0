"""PLY files: 3DGS models, and coloured points such as 3DGS's ``input.ply``.

A model is the element ``vertex`` of a PLY: one row per Gaussian, raw values (opacity as logit, scale as logarithm). Any
property order, any byte order, any number type and further scalar properties are read. Elements after ``vertex`` are
not kept. The header is checked before rows are read.
"""

import io
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyListProperty

from gspure.arrays import Float64, UInt8
from gspure.constants import LARGEST, SH_DC
from gspure.errors import InputError, reading
from gspure.files import replacing
from gspure.model.compressed import is_packed, read_packed, require_harmonics
from gspure.model.gaussians import COLOUR, CORE, NORMALS, SCALES, Gaussians
from gspure.model.header import Header, header_of, read_header, require_size
from gspure.progress import warn

_POSITION: Final = ("x", "y", "z")
_RGB: Final = ("red", "green", "blue")
_GREY: Final = 128
_THIN: Final = 1e-3  # the third axis of a flat Gaussian, as a share of its shorter one; ours
_FINE: Final = 1 / 200  # largest step of coordinates in float32, as a share of the median Gaussian; ours

_WINDOWS_NAN: Final = re.compile(r"nan\(\w*\)|1\.#(IND|QNAN|SNAN)\d*", re.IGNORECASE)
_WINDOWS_INF: Final = re.compile(r"1\.#INF\d*", re.IGNORECASE)


def read_ply(path: Path) -> Gaussians:
    """Read a 3DGS PLY: binary of either byte order or ASCII, with spherical harmonics of degree 0 to 3 or no colour.

    Return the rows of ``element vertex``, little-endian, with the file's columns and the header's comments. Those of a
    little-endian binary file are read-only. Properties that are named or stored in another way are `converted` to those
    of 3DGS, with a warning. Values are not checked; see `gspure.model.finite`.
    """
    header = read_header(path, "a 3DGS .ply")
    if is_packed(header):
        return read_packed(path, header)
    dtype = _row_type(path, header)
    _require_rows(path, header.content["vertex"].count)
    columns = converted(np.empty(0, dtype))[0].dtype
    _require_columns(path, columns, "a mesh" if "face" in header.content else "a plain point cloud")
    table, changes, comments = converted(_rows(path, header, dtype))
    if changes:
        warn(f"{path}: {'; '.join(changes)}")
    return Gaussians(table, header.comments + comments)


def write_ply(path: Path, model: Gaussians) -> None:
    """Write a binary little-endian PLY with the table's columns as they are, whole or not at all.

    A vanilla model is written byte for byte as its trainer wrote it. A model without rows is refused, as in `read_ply`.
    """
    _require_rows(path, len(model))
    _write(path, np.ascontiguousarray(model.table), model.comments)


def read_point_ply(path: Path) -> tuple[Float64, UInt8]:
    """Read positions [P,3] and 8-bit colours [P,3]; points without colour are grey."""
    header = read_header(path, "a PLY of points")
    dtype = _row_type(path, header)
    names = dtype.names or ()
    is_coloured = {*_RGB} <= {*names}
    for name in _POSITION:
        if name not in names:
            raise InputError(path, name, expected="a coordinate of every point", found="another property")
    for name in _RGB if is_coloured else ():
        if dtype[name] != np.uint8:
            raise InputError(path, name, expected="8 bits", found="another property")
    rows = _rows(path, header, dtype)
    with np.errstate(invalid="ignore"):  # signalling not-a-numbers
        xyz = np.column_stack([rows[name].astype(np.float64) for name in _POSITION])
    require_coordinates(path, xyz)
    rgb = np.column_stack([rows[name] for name in _RGB]) if is_coloured else np.full(xyz.shape, _GREY, np.uint8)
    return xyz, rgb


def require_coordinates(path: Path, xyz: Float64) -> None:
    """Refuse positions [P,3] that are not finite, or larger than `LARGEST`."""
    bad = np.flatnonzero(~(np.abs(xyz) <= LARGEST).all(axis=1)).tolist()
    if bad:
        position = " ".join(map(str, xyz[bad[0]].tolist()))
        raise InputError(path, f"point {bad[0]}", expected=f"coordinates within ±{LARGEST:g}", found=position)


def write_point_ply(path: Path, xyz: NDArray[Any], rgb: UInt8) -> None:
    """Write points as 3DGS's input.ply (float32 positions, zero normals, 8-bit colours), whole or not at all."""
    columns = dict(zip(_POSITION, xyz.T, strict=True)) | dict(zip(_RGB, rgb.T, strict=True))
    table = np.zeros(len(xyz), [(name, "<f4") for name in _POSITION + NORMALS] + [(name, "u1") for name in _RGB])
    for name, column in columns.items():
        table[name] = column
    _write(path, table)


def _write(path: Path, table: NDArray[np.void], comments: tuple[str, ...] = ()) -> None:
    with replacing(path) as temporary, temporary.open("wb") as stream:
        stream.write(header_of(table, comments))
        stream.write(np.ascontiguousarray(table).data)  # `tofile` does not say that a disk is full


def _row_type(path: Path, header: Header) -> np.dtype[np.void]:
    """Return the little-endian type of the rows of ``vertex``, which must come first and have no lists."""
    names = [element.name for element in header.content.elements]
    if names[:1] != ["vertex"]:
        raise InputError(path, "element vertex", expected="to come first", found=", ".join(names) or "no element")
    for ply_property in header.content["vertex"].properties:
        if isinstance(ply_property, PlyListProperty):
            raise InputError(path, ply_property.name, expected="one value per row", found="a list property")
    dtype: np.dtype[np.void] = np.dtype(header.content["vertex"].dtype("<"))
    return dtype


def _require_rows(path: Path, count: int) -> None:
    if count < 1:
        raise InputError(path, "element vertex", expected="at least one row", found=f"{count} rows")


def _require_columns(path: Path, dtype: np.dtype[np.void], lookalike: str) -> None:
    """Refuse rows that lack a property of 3DGS: the core, and all colour columns if there are any.

    `lookalike` is the kind of file that a PLY without the core may be.
    """
    stored = dtype.names or ()
    rest_count = len(Gaussians(np.empty(0, dtype)).columns_named("f_rest_"))
    require_harmonics(path, rest_count / 3)
    rest = [f"f_rest_{i}" for i in range(rest_count)]
    required = [*CORE]
    if rest or not {*COLOUR}.isdisjoint(stored):
        required += [*COLOUR, *rest]
    missing = next((name for name in required if name not in stored), None)
    if missing is None:
        return
    unknown = " ".join(name for name in stored if name not in {*CORE, *COLOUR, *NORMALS, *rest})
    hint = f"renamed? It has {unknown}" if unknown else None
    if {*CORE[3:]}.isdisjoint(stored) and len(stored) < len(CORE):
        hint = f"{lookalike}: `gspure train` makes a model"
    raise InputError(path, missing, expected="a property of 3DGS", found="no such property", hint=hint)


def _rows(path: Path, file: Header, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """Return the rows that the header counts; those of a little-endian binary file are read-only."""
    header = file.content
    count = header["vertex"].count
    size = len(file.file) - file.size
    if header.text:
        row_bytes = 2 * len(dtype.names or ())  # a digit and a separator per number
        room = (size + 1) // row_bytes  # the last separator may be missing
    else:
        room = size // dtype.itemsize
    if not 0 <= count <= room:
        hint = "cut short: copy or download it again"
        raise InputError(path, "element vertex", expected=f"{count} rows", found=f"room for {room}", hint=hint)
    if header.text:
        return _parsed(path, file, dtype)
    stored_dtypes = [np.dtype(element.dtype(header.byte_order)) for element in header.elements]
    if not any(stored.hasobject for stored in stored_dtypes):  # lists make the size of an element unknown
        sizes = (e.count * stored.itemsize for e, stored in zip(header.elements, stored_dtypes, strict=True))
        require_size(path, file, sum(sizes))
    if not count:
        return np.empty(0, dtype)
    return np.frombuffer(file.file, stored_dtypes[0], count, file.size).astype(dtype, copy=False)


def _parsed(path: Path, file: Header, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """Return the rows of an ASCII file, parsed by numpy, several times faster than plyfile."""
    count = file.content["vertex"].count
    stream = io.BytesIO(file.file)
    stream.seek(file.size)
    with reading(path, "one number per property, in its range", "element vertex"):
        text = io.TextIOWrapper(stream, encoding="latin-1")
        try:
            lines = map(_portable, iter(text.readline, ""))
            rows = np.loadtxt(lines, dtype, comments=None, max_rows=count, ndmin=1)
        except ValueError as error:
            raise ValueError(str(error).partition(";")[0]) from error  # without numpy's advice to programmers
        if len(rows) != count:
            raise ValueError(f"{len(rows)} rows, not {count}")
        if len(file.content.elements) == 1 and any(map(str.strip, text)):
            warn(f"{path}: text after the last of {count} rows that the header names is not read")
        return rows


def _portable(line: str) -> str:
    """Return a line with NaN and infinity as on Linux; Windows writes -nan(ind), 1.#QNAN or 1.#INF."""
    return _WINDOWS_INF.sub("inf", _WINDOWS_NAN.sub("nan", line)) if "(" in line or "#" in line else line


def offset_comment(offset: Float64) -> str:
    """Return the comment that names the `offset` [3] around which a model lies."""
    return "gspure offset " + " ".join(map(str, offset.tolist()))


@np.errstate(over="ignore", invalid="ignore")  # `gspure.model.finite` handles infinities
def converted(rows: NDArray[np.void]) -> tuple[NDArray[np.void], list[str], tuple[str, ...]]:
    """Return rows [K] with 3DGS's properties, the changes to them as text, and at most one comment.

    Properties that images depend on become float32. Rows that need no change are returned as they are. Nothing is
    invented for rows without scales or opacity, which are no Gaussians. If float32 would round coordinates of more
    digits, they become relative to an offset, which the comment names.
    """
    columns: dict[str, NDArray[Any]] = {name: rows[name] for name in rows.dtype.names or ()}
    changes: list[str] = []
    comments: tuple[str, ...] = ()
    if {*_RGB, "opacity"} <= columns.keys() and "f_dc_0" not in columns:
        shades = zip(COLOUR, (columns.pop(name) for name in _RGB), strict=True)
        columns |= {name: (_unit(shade) - 0.5) / np.float32(SH_DC) for name, shade in shades}
        changes.append(f"colours {', '.join(_RGB)} become f_dc_0..2")
    if {"scale_0", "scale_1"} <= columns.keys() and "scale_2" not in columns:
        columns["scale_2"] = np.minimum(columns["scale_0"], columns["scale_1"]) + np.float32(math.log(_THIN))
        changes.append(f"flat Gaussians (2DGS) get scale_2, {_THIN:g} of their shorter axis")
    numbered = Gaussians(rows[:0]).columns_named("f_rest_")
    drawn = [name for name in (*CORE, *COLOUR, *numbered) if name in columns]
    wrong_types = sorted({str(columns[name].dtype) for name in drawn} - {"float32"})
    if wrong_types:
        changes.append(f"properties of type {', '.join(wrong_types)} become float32")
    if not changes:
        return rows, [], ()
    offset = _offset(columns)
    if offset.any():
        columns |= {name: columns[name] - start for name, start in zip("xyz", offset, strict=True)}
        comments = (offset_comment(offset),)
        changes.append(f"coordinates become relative to {' '.join(map(str, offset.tolist()))}, and cameras too")
    types = [(name, "<f4" if name in drawn else column.dtype) for name, column in columns.items()]
    table = np.empty(len(rows), types)
    for name, column in columns.items():
        table[name] = column
    return table, changes, comments


def _offset(columns: Mapping[str, NDArray[Any]]) -> Float64:
    """Return the median centre, rounded, if coordinates are float64 and float32 is too coarse there; else zeros."""
    scales = [columns[name] for name in SCALES if name in columns]
    if not scales or not {*"xyz"} <= columns.keys() or np.float64 not in [columns[name].dtype for name in "xyz"]:
        return np.zeros(3)
    means = np.column_stack([columns[name] for name in "xyz"])
    rows = np.isfinite(means).all(axis=1)
    if not rows.any():
        return np.zeros(3)
    centre = np.round(np.median(means[rows], axis=0))
    size = np.exp(np.median(np.max(scales, axis=0)[rows]))
    step = np.spacing(np.abs(centre).max().astype(np.float32))
    return centre if step > _FINE * size else np.zeros(3)


def _unit(shades: NDArray[Any]) -> NDArray[np.float32]:
    """Return stored colours as 0 to 1; white is the largest number of an unsigned type, else 255 if any is above 1."""
    if shades.dtype.kind == "u":
        return np.asarray(shades / np.float32(np.iinfo(shades.dtype).max), np.float32)
    return np.asarray(shades / np.float32(255 if (shades > 1).any() else 1), np.float32)
