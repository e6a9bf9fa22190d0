"""PLY files: 3DGS models, and coloured points such as 3DGS's ``input.ply``.

A model is the element ``vertex`` of a PLY: one row per Gaussian, raw values (opacity as logit, scale as logarithm). Any
property order, any byte order, any number type and further scalar properties are read. Elements after ``vertex`` are
not kept. The header is checked before rows are read.
"""

import io
import math
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
from gspure.model.compressed import is_packed, read_packed
from gspure.model.gaussians import COEFFICIENTS, COLOUR, CORE, NORMALS, SCALES, Gaussians
from gspure.model.header import Header, header_of, read_header, require_size
from gspure.progress import warn

_POSITION: Final = ("x", "y", "z")
_RGB: Final = ("red", "green", "blue")
_GREY: Final = 128
_THIN: Final = 1e-3  # the third axis of a flat Gaussian, as a share of its shorter one; ours
_FINE: Final = 1 / 200  # largest step of coordinates in float32, as a share of the median Gaussian; ours


def read_ply(path: Path) -> Gaussians:
    """Read a 3DGS PLY: binary of either byte order or ASCII, spherical harmonics of degree 0 to 3 or no colour at all.

    Return the rows of ``element vertex``, little-endian, with the file's columns and the header's comments. A
    little-endian binary file is mapped: its table is read-only and takes memory only where it is used. Other properties
    are `converted` to those of 3DGS, with a warning. Values are not checked; see `gspure.model.finite`.
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

    A vanilla model comes out byte for byte as its trainer wrote it. A model without rows is refused, as in `read_ply`.
    """
    _require_rows(path, len(model))
    _write(path, np.ascontiguousarray(model.table), model.comments)


def read_point_ply(path: Path) -> tuple[Float64, UInt8]:
    """Read positions [P,3] and 8-bit colours [P,3]; points without colour are grey."""
    header = read_header(path, "a PLY of points")
    dtype = _row_type(path, header)
    is_coloured = {*_RGB} <= {*(dtype.names or ())}
    for name in (*_POSITION, *(_RGB if is_coloured else ())):
        if name not in (dtype.names or ()) or (name in _RGB and dtype[name] != np.uint8):
            expected = "8 bits" if name in _RGB else "a coordinate of every point"
            raise InputError(path, name, expected=expected, found="another property")
    rows = _rows(path, header, dtype)
    with np.errstate(invalid="ignore"):  # signalling not-a-numbers
        xyz = np.column_stack([rows[name].astype(np.float64) for name in _POSITION])
    require_coordinates(path, xyz)
    return xyz, np.column_stack([rows[name] for name in _RGB]) if is_coloured else np.full(xyz.shape, _GREY, np.uint8)


def require_coordinates(path: Path, xyz: Float64) -> None:
    """Refuse positions [P,3] that are not finite, or above `LARGEST`."""
    if bad := np.flatnonzero(~(np.abs(xyz) <= LARGEST).all(axis=1)).tolist():
        expected = f"coordinates within ±{LARGEST:g}"
        raise InputError(path, f"point {bad[0]}", expected=expected, found=" ".join(map(str, xyz[bad[0]].tolist())))


def write_point_ply(path: Path, xyz: NDArray[Any], rgb: UInt8) -> None:
    """Write points as 3DGS's input.ply (float32 positions, zero normals, 8-bit colours), whole or not at all."""
    table = np.zeros(len(xyz), [(name, "<f4") for name in _POSITION + NORMALS] + [(name, "u1") for name in _RGB])
    for names, values in ((_POSITION, xyz), (_RGB, rgb)):
        for name, column in zip(names, values.T, strict=True):
            table[name] = column
    _write(path, table)


def _write(path: Path, table: NDArray[np.void], comments: tuple[str, ...] = ()) -> None:
    with replacing(path) as temporary, temporary.open("wb") as stream:
        stream.write(header_of(table, comments))
        table.tofile(stream)


def _row_type(path: Path, header: Header) -> np.dtype[np.void]:
    """Return the little-endian type of the rows of ``vertex``, which comes first and has no lists."""
    names = [element.name for element in header.content.elements]
    if names[:1] != ["vertex"]:
        raise InputError(path, "element vertex", expected="to come first", found=", ".join(names) or "no element")
    for stored in header.content["vertex"].properties:
        if isinstance(stored, PlyListProperty):
            raise InputError(path, stored.name, expected="one value per row", found="a list property")
    dtype: np.dtype[np.void] = np.dtype(header.content["vertex"].dtype("<"))
    return dtype


def _require_rows(path: Path, count: int) -> None:
    if count < 1:
        raise InputError(path, "element vertex", expected="at least one row", found=f"{count} rows")


def _require_columns(path: Path, dtype: np.dtype[np.void], other: str) -> None:
    """Refuse rows that lack a property of 3DGS: the core, and all colour columns if there are any."""
    names = Gaussians(np.empty(0, dtype)).columns_named("f_rest_")
    if len(names) not in [3 * count for count in COEFFICIENTS]:
        found = f"{len(names)} properties"
        raise InputError(path, "f_rest_*", expected="0, 9, 24 or 45 properties (SH degree 0 to 3)", found=found)
    rest = [f"f_rest_{i}" for i in range(len(names))]
    has_colour = rest or not {*COLOUR}.isdisjoint(dtype.names or ())
    for name in (*CORE, *(COLOUR if has_colour else ()), *rest):
        if name not in (stored := dtype.names or ()):
            unknown = " ".join(known for known in stored if known not in {*CORE, *COLOUR, *NORMALS, *rest})
            is_other = {*CORE[3:]}.isdisjoint(stored) and len(stored) < len(CORE)
            hint = f"{other}: `gspure train` makes a model" if is_other else unknown and f"renamed? It has {unknown}"
            raise InputError(path, name, expected="a property of 3DGS", found="no such property", hint=hint)


def _rows(path: Path, file: Header, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """Return the rows, as many as the header names; those of a little-endian binary file are mapped and read-only."""
    header, offset = file.content, file.size
    count, rest = header["vertex"].count, path.stat().st_size - offset
    row_bytes = dtype.itemsize
    if header.text:
        row_bytes = 2 * len(dtype.names or ())  # a digit and a separator each, the last of which may lack
    if not 0 <= count <= (room := (rest + header.text) // row_bytes):
        hint = "cut short: copy or download it again"
        raise InputError(path, "element vertex", expected=f"{count} rows", found=f"room for {room}", hint=hint)
    if header.text:
        return _parsed(path, file, dtype)
    stored = [(element.count, np.dtype(element.dtype(header.byte_order))) for element in header.elements]
    if not any(each.hasobject for _, each in stored):  # lists make the size of an element unknown
        require_size(path, file, sum(rows * each.itemsize for rows, each in stored))
    if not count:
        return np.empty(0, dtype)
    return np.memmap(path, stored[0][1], "r", offset, count).view(np.ndarray).astype(dtype, copy=False)


def _parsed(path: Path, file: Header, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """Return the rows of an ASCII file; numpy's parser is several times faster than plyfile's."""
    count = file.content["vertex"].count
    with reading(path, "one number per property, in its range", "element vertex"), path.open("rb") as stream:
        stream.seek(file.size)
        text = io.TextIOWrapper(stream, encoding="latin-1")
        try:
            rows = np.loadtxt(iter(text.readline, ""), dtype, comments=None, max_rows=count, ndmin=1)
        except ValueError as error:
            raise ValueError(str(error).partition(";")[0]) from error  # without numpy's advice to programmers
        if len(rows) != count:
            raise ValueError(f"{len(rows)} rows, not {count}")
        if len(file.content.elements) == 1 and any(map(str.strip, text)):
            warn(f"{path}: text after the last of {count} rows that the header names is not read")
        return rows


def offset_comment(offset: Float64) -> str:
    """Return the comment of a model that lies around `offset` [3]."""
    return "gspure offset " + " ".join(map(str, offset.tolist()))


@np.errstate(over="ignore", invalid="ignore")  # infinities are found where models are made drawable
def converted(rows: NDArray[np.void]) -> tuple[NDArray[np.void], list[str], tuple[str, ...]]:
    """Return rows [K] with 3DGS's properties, float32 as far as images depend on them; what was changed; a comment.

    Rows that have these are returned as they are. Those without scales or opacity are no Gaussians, and stay so. If
    float32 would round coordinates of more digits, they become relative to an offset, which the comment names.
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
    if others := sorted({str(columns[name].dtype) for name in drawn} - {"float32"}):
        changes.append(f"properties of type {', '.join(others)} become float32")
    if not changes:
        return rows, [], ()
    if (offset := _offset(columns)).any():
        columns |= {name: columns[name] - start for name, start in zip("xyz", offset, strict=True)}
        comments = (offset_comment(offset),)
        changes.append(f"coordinates become relative to {' '.join(map(str, offset.tolist()))}, and cameras too")
    table = np.empty(len(rows), [(name, "<f4" if name in drawn else column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return table, changes, comments


def _offset(columns: Mapping[str, NDArray[Any]]) -> Float64:
    """Return the median centre, rounded, if float32 is too coarse for coordinates there that are float64, else 0."""
    scales = [columns[name] for name in SCALES if name in columns]
    if not scales or not {*"xyz"} <= columns.keys() or np.float64 not in [columns[name].dtype for name in "xyz"]:
        return np.zeros(3)
    means = np.column_stack([columns[name] for name in "xyz"])
    rows = np.isfinite(means).all(axis=1)
    if not rows.any():
        return np.zeros(3)
    centre, size = np.round(np.median(means[rows], axis=0)), np.exp(np.median(np.max(scales, axis=0)[rows]))
    return centre if np.spacing(np.abs(centre).max().astype(np.float32)) > _FINE * size else np.zeros(3)


def _unit(shades: NDArray[Any]) -> NDArray[np.float32]:
    """Return colours from 0 to 1 of stored ones: in the range of an unsigned type, else to 255 if any is above 1."""
    if shades.dtype.kind == "u":
        return np.asarray(shades / np.float32(np.iinfo(shades.dtype).max), np.float32)
    return np.asarray(shades / np.float32(255 if (shades > 1).any() else 1), np.float32)
