"""Coloured points, such as 3DGS's ``input.ply``, and meshes as PLY files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData, PlyElement

from gspure.artifacts import replacing
from gspure.constants import LARGEST
from gspure.errors import InputError
from gspure.files import Float64, Indices, UInt8
from gspure.model.gaussians import NORMALS
from gspure.model.vertices import Vertices

_POSITION: Final = ("x", "y", "z")
_COLOUR: Final = ("red", "green", "blue")
_GREY: Final = 128


def read_point_ply(path: Path) -> tuple[Float64, UInt8]:
    """Read positions [P,3] and 8-bit colours [P,3]; points without colour are grey.

    Raise `InputError` if the file is missing, corrupt or no PLY, or has no positions, colours that are not 8-bit,
    or a coordinate is not finite or above `LARGEST`.
    """
    vertices = Vertices.of(path, "a PLY of points")
    for name in _POSITION:
        if name not in vertices.dtypes:
            raise InputError(path, name, expected="a coordinate of every point", found="no such property")
    coloured = vertices.dtypes.keys() >= {*_COLOUR}
    for name in _COLOUR if coloured else ():
        if vertices.dtypes[name] != np.uint8:
            raise InputError(path, name, expected="8 bits", found=str(vertices.dtypes[name]))
    rows = vertices.rows()
    with np.errstate(invalid="ignore"):  # signalling not-a-numbers
        xyz = np.column_stack([rows[name].astype(np.float64) for name in _POSITION])
    require_coordinates(path, xyz)
    if not coloured:
        return xyz, np.full(xyz.shape, _GREY, np.uint8)
    return xyz, np.column_stack([rows[name] for name in _COLOUR])


def require_coordinates(path: Path, xyz: Float64) -> None:
    """Refuse positions [P,3] that are not finite, or above `LARGEST`."""
    if bad := np.flatnonzero(~(np.abs(xyz) <= LARGEST).all(axis=1)).tolist():
        expected = f"coordinates within ±{LARGEST:g}"
        raise InputError(path, f"point {bad[0]}", expected=expected, found=" ".join(map(str, xyz[bad[0]].tolist())))


def write_point_ply(path: Path, xyz: NDArray[Any], rgb: UInt8) -> None:
    """Write points as 3DGS's input.ply (float32 positions, zero normals, 8-bit colours), whole or not at all."""
    table = np.zeros(len(xyz), [(name, "<f4") for name in _POSITION + NORMALS] + [(name, "u1") for name in _COLOUR])
    for names, values in ((_POSITION, xyz), (_COLOUR, rgb)):
        for name, column in zip(names, values.T, strict=True):
            table[name] = column
    with replacing(path) as temporary:
        PlyData([PlyElement.describe(table, "vertex")], byte_order="<").write(str(temporary))


@dataclass(frozen=True)
class Mesh:
    """Triangles: `vertices` [V,3] in world units, `faces` [F,3], anticlockwise as seen from outside."""

    vertices: Float64
    faces: Indices

    @property
    def corners(self) -> Float64:
        """Positions of the corners of each face, [F,3,3]."""
        return np.asarray(self.vertices[self.faces])


def write_mesh_ply(path: Path, mesh: Mesh) -> None:
    """Write a binary PLY (float32 vertices, faces as ``vertex_indices``), whole or not at all."""
    vertices = np.empty(len(mesh.vertices), [(name, "<f4") for name in "xyz"])
    for name, column in zip("xyz", mesh.vertices.T, strict=True):
        vertices[name] = column
    faces: NDArray[Any] = np.empty(len(mesh.faces), [("vertex_indices", "<i4", (3,))])
    faces["vertex_indices"] = mesh.faces
    with replacing(path) as temporary:
        elements = [PlyElement.describe(vertices, "vertex"), PlyElement.describe(faces, "face")]
        PlyData(elements, byte_order="<").write(str(temporary))
