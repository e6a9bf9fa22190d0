"""3DGS models as PLY files.

A model is the element ``vertex`` of a PLY: one row per Gaussian, raw values (opacity as logit, scale as logarithm). Any
property order, any byte order and further scalar properties are read. Elements after ``vertex`` are not kept. A
compressed PLY is read, too.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from plyfile import PlyData, PlyElement

from gspure.artifacts import replacing
from gspure.constants import MAX_SH_DEGREE
from gspure.errors import InputError
from gspure.model.compressed.packed_ply import is_packed, read_packed
from gspure.model.gaussians import COLOUR, CORE, Gaussians, columns_named, sh_columns
from gspure.model.vertices import Vertices, read_header


def read_ply(path: Path) -> Gaussians:
    """Read a 3DGS PLY: binary of either byte order or ASCII, spherical harmonics of degree 0 to 3 or no colour at all.

    Return the rows of ``element vertex``, little-endian, with the file's columns and the header's comments. A
    little-endian binary file is mapped: its table is read-only and takes memory only where it is used. A compressed PLY
    is unpacked in memory. Values are not checked; see `gspure.model.finite`.

    Raise `InputError` if the file is no PLY or no 3DGS model: a property is missing or is not float32, the number of
    ``f_rest_*`` fits no degree, a property is a list, there is no row, or there are fewer rows than the header says.
    """
    path = Path(path)
    header, offset = read_header(path, "a 3DGS .ply")
    if is_packed(header):
        return read_packed(path, header, offset)
    vertices = Vertices.below(path, header, offset)
    _check_properties(vertices)
    return Gaussians(vertices.rows(), vertices.comments)


def write_ply(path: Path, model: Gaussians) -> None:
    """Write a binary little-endian PLY with the table's columns as they are, whole or not at all.

    A vanilla model comes out byte for byte as its trainer wrote it. A model without rows is refused, as in `read_ply`.
    """
    _require_rows(path, len(model))
    vertex = PlyElement.describe(np.ascontiguousarray(model.table), "vertex")
    with replacing(path) as temporary:
        PlyData([vertex], byte_order="<", comments=model.comments).write(str(temporary))


def _check_properties(vertices: Vertices) -> None:
    """Refuse an empty model, colour that fits no degree, and core properties that are not float32."""
    path, dtypes = vertices.path, vertices.dtypes
    _require_rows(path, vertices.count)
    required = _required(path, dtypes)
    for name in required:
        if name not in dtypes:
            content = "a mesh" if "face" in vertices.header else "a plain point cloud"
            hint = f"{content}, not a 3DGS model" if not dtypes.keys() & {*CORE[3:]} else None
            raise InputError(path, name, expected="a float32 property", found="no such property", hint=hint)
    for name in required:
        if dtypes[name] != np.float32:
            raise InputError(path, name, expected="a float32 property", found=str(dtypes[name]))


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
