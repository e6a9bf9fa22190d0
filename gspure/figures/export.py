"""Point clouds as files: glTF for viewers, VTP for ParaView and VTK."""

import base64
import json
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.artifacts import write_text
from gspure.figures.clouds import Cloud
from gspure.files import UInt8

_FLOAT: Final = 5126
_UNSIGNED_SHORT: Final = 5123
_ARRAY_BUFFER: Final = 34962
_POINTS: Final = 0


def write_vtp(path: Path, cloud: Cloud) -> None:
    """Write points, colours (``rgb``) and scalars as VTK XML poly data."""
    import pyvista as pv
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    mesh = pv.PolyData(cloud.points.astype(np.float32))
    mesh["rgb"] = cloud.colours
    for name, values in cloud.scalars.items():
        mesh[name] = values
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(mesh)
    writer.WriteToOutputStringOn()  # on a full disk, VTK's own files end early without an error
    writer.Write()
    write_text(path, writer.GetOutputString(), checksum=True)


def write_gltf(path: Path, cloud: Cloud, axes: NDArray[np.floating]) -> None:
    """Write a cloud of one or more points as one self-contained glTF 2.0 file of unlit points.

    Scalars become application-specific attributes (``_RANK``, ...). VTK's exporter needs OpenGL and stores neither
    vertex colours nor scalars of points.

    The rows of `axes` [3,3] are the world's right, up and front; glTF's are x, y and z, so the node that holds the
    points is rotated.
    """
    points = cloud.points.astype("<f4")
    attributes: dict[str, NDArray[Any]] = {"POSITION": points, "COLOR_0": _linear_rgba(cloud.colours)}
    attributes |= {f"_{name.upper()}": values.astype("<f4") for name, values in cloud.scalars.items()}
    accessors: list[dict[str, Any]] = []
    views: list[dict[str, int]] = []
    offset = 0
    for array in attributes.values():
        accessors.append(_accessor(array, len(views)))
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": array.nbytes, "target": _ARRAY_BUFFER})
        offset += array.nbytes
    accessors[0] |= {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}  # glTF demands them here

    data = base64.b64encode(b"".join(array.tobytes() for array in attributes.values())).decode()
    rotation = np.eye(4)
    rotation[:3, :3] = axes
    document = {
        "asset": {"version": "2.0", "generator": "gspure"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "matrix": rotation.T.ravel().tolist()}],  # glTF stores columns
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": dict(zip(attributes, range(len(attributes)), strict=True)),
                        "mode": _POINTS,
                        "material": 0,
                    }
                ]
            }
        ],
        "materials": [{"extensions": {"KHR_materials_unlit": {}}}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": offset, "uri": "data:application/octet-stream;base64," + data}],
    }
    write_text(path, json.dumps(document, separators=(",", ":")), checksum=True)


def _accessor(array: NDArray[Any], view: int) -> dict[str, Any]:
    kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[array.shape[1] if array.ndim > 1 else 1]
    accessor = {"bufferView": view, "componentType": _FLOAT, "count": len(array), "type": kind}
    return accessor | ({"componentType": _UNSIGNED_SHORT, "normalized": True} if array.dtype == "<u2" else {})


def _linear_rgba(colours: UInt8) -> NDArray[np.uint16]:
    """Return sRGB bytes [N,3] as glTF's vertex colours: linear, opaque, 16 bits since 8 would lose the dark ones."""
    srgb = np.arange(256) / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    rgba = np.full((len(colours), 4), 65535, "<u2")
    rgba[:, :3] = np.rint(linear * 65535)[colours]
    return rgba
