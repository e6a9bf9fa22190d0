"""cameras.json as 3DGS training writes it into its output folder, and our superset of it.

A list of objects with ``id``, ``img_name``, ``width``, ``height``, ``position`` (camera centre), ``rotation`` (camera
to world, by rows), ``fx`` and ``fy`` in pixels of that size. Its principal points are the image centres, and it names
no photographs. Our superset has optional keys: ``cx`` and ``cy`` (pixels), if the principal point is elsewhere;
``image``, the path of the photograph, relative to the file's folder; and ``k1 k2 p1 p2 k3 k4 k5 k6``, the distortion of
the lens. Programs that read the original format read ours.
"""

import json
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gspure.cameras.camera import Camera, intrinsics
from gspure.cameras.entry import Entry, with_finite_poses
from gspure.cameras.photographs import view_names
from gspure.errors import InputError
from gspure.files import write_text


def parse(source: Path, content: list[Any]) -> list[Camera]:
    """Return the cameras of a parsed cameras.json, in its order; `source` is the file it came from."""
    stored = [Entry(source, f"[{i}]", value) for i, value in enumerate(content)]
    entries = with_finite_poses(stored, "img_name", "position", "rotation")
    names = view_names(entries, "img_name", source)
    return [_camera(entry, name, source.parent) for entry, name in zip(entries, names, strict=True)]


def write_cameras(path: str | Path, cameras: Sequence[Camera], place: Path | None = None) -> None:
    """Write cameras as cameras.json, one view per line, with every digit of their float64 values.

    Paths of photographs are relative to `place`, the final folder of the file, by default the folder of `path`.

    >>> gspure.write_cameras("first.json", cameras[:1])
    >>> len(gspure.read_cameras("first.json"))
    1
    """
    path = Path(path)
    for name, count in Counter(camera.name for camera in cameras).most_common(1):
        if count > 1:
            raise InputError(path, "view names", expected="each name once", found=f"{count} times {name!r}")
    lines = (json.dumps(_values(i, camera, place or path.parent)) for i, camera in enumerate(cameras))
    write_text(path, "[\n" + ",\n".join(lines) + "\n]\n")


def _camera(entry: Entry, name: str, folder: Path) -> Camera:
    width = entry.pixels("width")
    height = entry.pixels("height")
    viewmat = np.eye(4)
    viewmat[:3, :3] = entry.rigid("rotation", (3, 3)).T
    viewmat[:3, 3] = -viewmat[:3, :3] @ entry.array("position", (3,))
    cx = entry.number("cx", width / 2)
    cy = entry.number("cy", height / 2)
    K = intrinsics(entry.positive("fx"), entry.positive("fy"), cx, cy)
    image = folder / entry.text("image") if "image" in entry else None
    return Camera(name, width, height, K, viewmat, image, entry.distortion())


def _values(index: int, camera: Camera, place: Path) -> dict[str, Any]:
    fx, fy, cx, cy = camera.numbers[2:6].tolist()
    pose = {"position": camera.centre.tolist(), "rotation": camera.viewmat[:3, :3].T.tolist()}
    size = {"width": camera.width, "height": camera.height}
    values: dict[str, Any] = {"id": index, "img_name": camera.name, **size, **pose, "fx": fx, "fy": fy}
    if (cx, cy) != (camera.width / 2, camera.height / 2):
        values |= {"cx": cx, "cy": cy}
    if camera.image is not None:
        values["image"] = os.path.relpath(camera.image.absolute(), place.resolve())
    return values
