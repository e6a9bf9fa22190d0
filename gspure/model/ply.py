"""3DGS models as PLY files.

A model is the element ``vertex`` of a PLY: one row per Gaussian, raw values (opacity as logit, scale as logarithm). Any
property order, any byte order and further scalar properties are read. Elements after ``vertex`` are not kept.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Collection
from pathlib import Path

import numpy as np
from plyfile import PlyData, PlyElement, PlyListProperty, PlyParseError

from gspure.artifacts import replacing
from gspure.constants import MAX_SH_DEGREE
from gspure.errors import InputError
from gspure.model.compressed import CONVERT, refuse_compressed
from gspure.model.gaussians import COLOUR, CORE, Gaussians, Table, columns_named, sh_columns

_HEADER_LIMIT = 1 << 20
"""No header is longer: of a file that is no PLY, no more than this is searched for the header's end."""


def read_ply(path: Path) -> Gaussians:
    """Read a 3DGS PLY: binary of either byte order or ASCII, spherical harmonics of degree 0 to 3 or no colour at all.

    A little-endian binary file is mapped: its table is read-only and takes memory only as it is touched. Values are not
    judged, infinities and not-a-numbers included; `gspure.model.finite` does that.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Gaussians
        The rows of ``element vertex``, little-endian, columns in the file's order, and the header's comments.

    Raises
    ------
    InputError
        If the file is no PLY or no 3DGS model: a property is missing or is not float32, the number of ``f_rest_*`` fits
        no degree, a property is a list, there is no row, or there are fewer rows than the header says.

    """
    path = Path(path)
    header, offset = _read_header(path)
    vertex = _vertex(path, header)
    _check_properties(path, vertex, "a mesh" if "face" in header else "a plain point cloud")
    table = _parse_rows(path, vertex, offset) if header.text else _map_rows(path, vertex, offset, header.byte_order)
    return Gaussians(table, (*header.comments, *header.obj_info, *vertex.comments))


def write_ply(path: Path, model: Gaussians) -> None:
    """Write a binary little-endian PLY with the table's columns as they are, whole or not at all.

    A vanilla model comes out byte for byte as its trainer wrote it.
    """
    vertex = PlyElement.describe(np.ascontiguousarray(model.table), "vertex")
    with replacing(path) as temporary:
        PlyData([vertex], byte_order="<", comments=model.comments).write(str(temporary))


def _read_header(path: Path) -> tuple[PlyData, int]:
    """Return the header and its length in bytes, before anything is allocated for what it claims."""
    refuse_compressed(path)
    try:
        with path.open("rb") as stream:
            head = io.BytesIO(stream.read(_HEADER_LIMIT))
        # plyfile has no public way to see the header alone, and `PlyData.read` allocates whatever a header claims.
        return PlyData._parse_header(head), head.tell()  # noqa: SLF001
    except OSError as error:
        raise InputError(path, "file", expected="a readable .ply", found=error.strerror or str(error)) from None
    except (PlyParseError, ValueError) as error:
        raise InputError(path, "header", expected="the header of a PLY", found=str(error)) from None


def _vertex(path: Path, header: PlyData) -> PlyElement:
    """Return the element that holds the Gaussians: the first one."""
    names = [element.name for element in header.elements]
    if "vertex" in names and "packed_position" in header["vertex"]:
        raise InputError(path, "format", expected="a 3DGS .ply", found="a compressed .ply", hint=CONVERT)
    if names[:1] != ["vertex"]:
        raise InputError(path, "element vertex", expected="to come first", found=", ".join(names) or "no element")
    vertex = header["vertex"]
    if vertex.count < 1:
        raise InputError(path, "element vertex", expected="at least one Gaussian", found=f"{vertex.count} rows")
    return vertex


def _check_properties(path: Path, vertex: PlyElement, otherwise: str) -> None:
    """Refuse lists, colour that fits no degree, and core properties that are missing or not float32.

    A file that has no Gaussians is called what it is `otherwise`.
    """
    for stored in vertex.properties:
        if isinstance(stored, PlyListProperty):
            raise InputError(path, stored.name, expected="one value per Gaussian", found="a list property")
    kinds = {stored.name: np.dtype(stored.dtype()) for stored in vertex.properties}
    required = _required(path, kinds)
    for name in required:
        if name not in kinds:
            hint = f"{otherwise}, not a 3DGS model" if not kinds.keys() & {*CORE[3:]} else None
            raise InputError(path, name, expected="a float32 property", found="no such property", hint=hint)
    for name in required:
        if kinds[name] != np.float32:
            raise InputError(path, name, expected="a float32 property", found=str(kinds[name]))


def _required(path: Path, names: Collection[str]) -> tuple[str, ...]:
    """Return the properties that these `names` must include: the core, and all of the colour if any of it is there."""
    count = len(columns_named(names, "f_rest_"))
    counts = [sh_columns(degree) for degree in range(MAX_SH_DEGREE + 1)]
    if count not in counts:
        expected = f"{', '.join(map(str, counts[:-1]))} or {counts[-1]} properties (SH degree 0 to {MAX_SH_DEGREE})"
        raise InputError(path, "f_rest_*", expected=expected, found=f"{count} properties")
    has_colour = count or columns_named(names, "f_dc_")
    return (*CORE, *(COLOUR if has_colour else ()), *(f"f_rest_{i}" for i in range(count)))


def _map_rows(path: Path, vertex: PlyElement, offset: int, byte_order: str) -> Table:
    """Map the rows of a binary file; those of a big-endian one are swapped into memory."""
    stored = vertex.dtype(byte_order)
    _check_size(path, vertex, offset, stored.itemsize)
    rows = np.memmap(path, stored, "r", offset, vertex.count).view(np.ndarray)
    return rows.astype(vertex.dtype("<"), copy=False)


def _parse_rows(path: Path, vertex: PlyElement, offset: int) -> Table:
    """Parse the rows of an ASCII file."""
    _check_size(path, vertex, offset - 1, 2 * len(vertex.properties))  # a digit and what ends it, but for the last one
    with path.open("rb") as stream, warnings.catch_warnings(), np.errstate(over="ignore"):
        warnings.simplefilter("ignore")  # numpy warns where there is no row; that is told below
        stream.seek(offset)
        text = io.TextIOWrapper(stream, encoding="ascii")
        try:
            # numpy's parser, since it is several times faster than plyfile's.
            rows = np.loadtxt(text, vertex.dtype("<"), comments=None, max_rows=vertex.count, ndmin=1)
        except ValueError as error:
            raise InputError(path, "element vertex", expected="one number per property", found=str(error)) from None
    if len(rows) < vertex.count:
        raise InputError(path, "element vertex", expected=f"{vertex.count} rows", found=f"{len(rows)} rows")
    return rows


def _check_size(path: Path, vertex: PlyElement, offset: int, row_bytes: int) -> None:
    """Refuse a file that is too short for the rows that its header claims, before they are allocated."""
    room = (path.stat().st_size - offset) // row_bytes
    if room < vertex.count:
        raise InputError(path, "element vertex", expected=f"{vertex.count} rows", found=f"room for {room}")
