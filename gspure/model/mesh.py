"""Triangle meshes, and their PLY files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData, PlyElement

from gspure.artifacts import replacing


@dataclass(frozen=True)
class Mesh:
    """Triangles: `vertices` [V,3] in world units, `faces` [F,3], anticlockwise as seen from outside."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.intp]

    @property
    def corners(self) -> NDArray[np.float64]:
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
