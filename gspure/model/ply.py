"""PLY files: 3DGS models, and coloured points such as 3DGS's ``input.ply``.

A model is the element ``vertex`` of a PLY: one row per Gaussian, raw values (opacity as logit, scale as logarithm). Any
property order, any byte order and further scalar properties are read. Elements after ``vertex`` are not kept. The
header is checked before rows are read.
"""

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData, PlyElement, PlyListProperty

from gspure.constants import LARGEST, MAX_SH_DEGREE
from gspure.errors import InputError, reading
from gspure.files import Float64, Indices, UInt8, replacing
from gspure.model.compressed import is_packed, read_packed
from gspure.model.gaussians import COLOUR, CORE, NORMALS, Gaussians, columns_named, sh_columns

_HEADER_LIMIT: Final = 1 << 20  # largest header in bytes; the search for its end stops there

_POSITION: Final = ("x", "y", "z")
_RGB: Final = ("red", "green", "blue")
_GREY: Final = 128


@dataclass(frozen=True)
class Mesh:
    """Triangles: `vertices` [V,3] in world units, `faces` [F,3], anticlockwise as seen from outside."""

    vertices: Float64
    faces: Indices

    @property
    def corners(self) -> Float64:
        """Positions of the corners of each face, [F,3,3]."""
        return np.asarray(self.vertices[self.faces])


def read_ply(path: Path) -> Gaussians:
    """Read a 3DGS PLY: binary of either byte order or ASCII, spherical harmonics of degree 0 to 3 or no colour at all.

    Return the rows of ``element vertex``, little-endian, with the file's columns and the header's comments. A
    little-endian binary file is mapped: its table is read-only and takes memory only where it is used. A compressed PLY
    is unpacked in memory. Values are not checked; see `gspure.model.finite`.

    Raise `InputError` if the file is no PLY or no 3DGS model: a property is missing or is not float32, the number of
    ``f_rest_*`` fits no degree, a property is a list, there is no row, or there are fewer rows than the header says.
    """
    header, offset = _read_header(path, "a 3DGS .ply")
    if is_packed(header):
        return read_packed(path, header, offset)
    vertices = _Vertices(path, header, offset)
    _require_rows(path, vertices.count)
    for name in _required(path, vertices.dtypes):
        if (found := vertices.dtypes.get(name)) is None:
            content = "a mesh" if "face" in header else "a plain point cloud"
            hint = f"{content}, not a 3DGS model" if not vertices.dtypes.keys() & {*CORE[3:]} else None
            raise InputError(path, name, expected="a float32 property", found="no such property", hint=hint)
        if found != np.float32:
            raise InputError(path, name, expected="a float32 property", found=str(found))
    return Gaussians(vertices.rows(), (*header.comments, *header.obj_info, *header["vertex"].comments))


def write_ply(path: Path, model: Gaussians) -> None:
    """Write a binary little-endian PLY with the table's columns as they are, whole or not at all.

    A vanilla model comes out byte for byte as its trainer wrote it. A model without rows is refused, as in `read_ply`.
    """
    _require_rows(path, len(model))
    vertex = PlyElement.describe(np.ascontiguousarray(model.table), "vertex")
    with replacing(path) as temporary:
        PlyData([vertex], byte_order="<", comments=model.comments).write(str(temporary))


def read_point_ply(path: Path) -> tuple[Float64, UInt8]:
    """Read positions [P,3] and 8-bit colours [P,3]; points without colour are grey.

    Raise `InputError` if the file is missing, corrupt or no PLY, or has no positions, colours that are not 8-bit,
    or a coordinate is not finite or above `LARGEST`.
    """
    vertices = _Vertices(path, *_read_header(path, "a PLY of points"))
    for name in _POSITION:
        if name not in vertices.dtypes:
            raise InputError(path, name, expected="a coordinate of every point", found="no such property")
    coloured = vertices.dtypes.keys() >= {*_RGB}
    for name in _RGB if coloured else ():
        if vertices.dtypes[name] != np.uint8:
            raise InputError(path, name, expected="8 bits", found=str(vertices.dtypes[name]))
    rows = vertices.rows()
    with np.errstate(invalid="ignore"):  # signalling not-a-numbers
        xyz = np.column_stack([rows[name].astype(np.float64) for name in _POSITION])
    require_coordinates(path, xyz)
    if not coloured:
        return xyz, np.full(xyz.shape, _GREY, np.uint8)
    return xyz, np.column_stack([rows[name] for name in _RGB])


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
    with replacing(path) as temporary:
        PlyData([PlyElement.describe(table, "vertex")], byte_order="<").write(str(temporary))


def _require_rows(path: Path, count: int) -> None:
    if count < 1:
        raise InputError(path, "element vertex", expected="at least one row", found=f"{count} rows")


def _required(path: Path, names: Mapping[str, object]) -> tuple[str, ...]:
    """Return the required properties, given all `names`: the core, and all colour columns if there are any."""
    count = len(columns_named(names, "f_rest_"))
    counts = [sh_columns(degree) for degree in range(MAX_SH_DEGREE + 1)]
    if count not in counts:
        expected = f"{', '.join(map(str, counts[:-1]))} or {counts[-1]} properties (SH degree 0 to {MAX_SH_DEGREE})"
        raise InputError(path, "f_rest_*", expected=expected, found=f"{count} properties")
    has_colour = count or columns_named(names, "f_dc_")
    return (*CORE, *(COLOUR if has_colour else ()), *(f"f_rest_{i}" for i in range(count)))


class _Vertices:
    """The element ``vertex``, the first one of a PLY; rows are not allocated before they are read.

    `offset` is the size of the header in bytes. Raise `InputError` if another element comes first, or a property is a
    list or has a name that does not print or holds a colon.
    """

    def __init__(self, path: Path, header: PlyData, offset: int) -> None:
        self.path, self.header, self.offset = path, header, offset
        names = [element.name for element in header.elements]
        if names[:1] != ["vertex"]:
            raise InputError(path, "element vertex", expected="to come first", found=", ".join(names) or "no element")
        self.count = int(header["vertex"].count)
        if self.count < 0:
            raise InputError(path, "element vertex", expected="0 rows or more", found=f"{self.count} rows")
        for stored in header["vertex"].properties:
            if isinstance(stored, PlyListProperty):
                raise InputError(path, stored.name, expected="one value per row", found="a list property")
            if not stored.name.isprintable() or ":" in stored.name:  # numpy writes no columns with colons
                raise InputError(path, "property", expected="a printable name without colons", found=repr(stored.name))
        self.dtypes = {stored.name: np.dtype(stored.dtype()) for stored in header["vertex"].properties}

    def rows(self) -> NDArray[np.void]:
        """Return the rows, little-endian; those of a little-endian binary file are mapped and read-only.

        Raise `InputError` if there are fewer rows than the header claims, something follows the last element,
        or a row of an ASCII file is malformed.
        """
        if self.header.text:
            return self._parsed()
        stored = self.header["vertex"].dtype(self.header.byte_order)
        self._require_room(self.offset, stored.itemsize)
        self._require_end()
        if not self.count:
            return np.empty(0, self.header["vertex"].dtype("<"))
        rows = np.memmap(self.path, stored, "r", self.offset, self.count).view(np.ndarray)
        return rows.astype(self.header["vertex"].dtype("<"), copy=False)

    def _parsed(self) -> NDArray[np.void]:
        self._require_room(self.offset - 1, 2 * len(self.dtypes))  # a digit and a separator, but the last
        with (
            reading(self.path, "one number per property, in its range", "element vertex"),
            self.path.open("rb") as stream,
        ):
            stream.seek(self.offset)
            text = io.TextIOWrapper(stream, encoding="ascii")
            # numpy's parser is several times faster than plyfile's.
            most = self.count + (len(self.header.elements) == 1)
            rows = np.loadtxt(text, self.header["vertex"].dtype("<"), comments=None, max_rows=most, ndmin=1)
        if len(rows) != self.count:
            raise InputError(self.path, "element vertex", expected=f"{self.count} rows", found=f"{len(rows)} rows")
        return rows

    def _require_room(self, offset: int, row_bytes: int) -> None:
        """Refuse a file that is too short for the rows that its header claims."""
        room = (self.path.stat().st_size - offset) // row_bytes
        if room < self.count:
            raise InputError(self.path, "element vertex", expected=f"{self.count} rows", found=f"room for {room}")

    def _require_end(self) -> None:
        """Refuse a binary file that goes on after its last element; lists make an element's size unknown."""
        stored = [(element.count, element.dtype(self.header.byte_order)) for element in self.header.elements]
        if any(dtype.hasobject for _, dtype in stored):
            return
        expected = self.offset + sum(count * dtype.itemsize for count, dtype in stored)
        if (size := self.path.stat().st_size) != expected:
            raise InputError(self.path, "file", expected=f"{expected} bytes", found=f"{size} bytes")


def _read_header(path: Path, content: str) -> tuple[PlyData, int]:
    """Return the header of a PLY that should hold `content`, and its size in bytes."""
    with reading(path, content), path.open("rb") as stream:
        head = io.BytesIO(stream.read(_HEADER_LIMIT))
        for number, line in enumerate(head.getvalue().partition(b"end_header")[0].splitlines(), start=1):
            if not line.isascii() and line.startswith((b"comment", b"obj_info")):
                found = line.decode(errors="replace")
                raise InputError(path, "file", expected=f"a comment in ASCII in line {number}", found=found)
        # plyfile cannot read only the header publicly, and `PlyData.read` allocates as many rows as it claims.
        return PlyData._parse_header(head), head.tell()  # noqa: SLF001
