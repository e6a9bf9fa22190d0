"""COLMAP's binary files: little-endian, a 64-bit count, then records without padding."""

import struct
from pathlib import Path
from typing import Any

import numpy as np

from gspure.cameras.colmap_records import MODEL_NAMES, Lens, Points, Pose, parameter_names
from gspure.errors import InputError

_COUNT = struct.Struct("<Q")
_LENS = struct.Struct("<iiQQ")  # camera id, model, width, height; parameters follow
_POSE = struct.Struct("<i7di")  # image id, quaternion, translation, camera id; name and 2-D points follow
_POINT = struct.Struct("<Q3d3BdQ")  # point id, xyz, rgb, error, track length; the track follows
_POINT_2D_BYTES = 24  # x, y, point id
_TRACK_BYTES = 8  # image id, index of the 2-D point


def lenses(path: Path) -> list[Lens]:
    """Read cameras.bin."""
    records = _Records(path)
    out = []
    for _ in range(records.count(_LENS.size)):
        camera_id, number, width, height = records.take(_LENS)
        model = MODEL_NAMES[number] if 0 <= number < len(MODEL_NAMES) else f"model {number}"
        names = parameter_names(path, camera_id, model)
        values = records.take(struct.Struct(f"<{len(names)}d"))
        out.append(Lens(camera_id, width, height, dict(zip(names, values, strict=True))))
    records.finish()
    return out


def poses(path: Path) -> list[Pose]:
    """Read images.bin without the 2-D points."""
    records = _Records(path)
    out = []
    for _ in range(records.count(_POSE.size + 1 + _COUNT.size)):
        image_id, *numbers, camera_id = records.take(_POSE)
        name = records.text()
        records.skip(records.count(_POINT_2D_BYTES) * _POINT_2D_BYTES)
        out.append(Pose(image_id, tuple(numbers[:4]), tuple(numbers[4:]), camera_id, name))
    records.finish()
    return out


def points(path: Path) -> Points:
    """Read points3D.bin without errors and tracks."""
    records = _Records(path)
    count = records.count(_POINT.size)
    xyz, rgb = np.empty((count, 3)), np.empty((count, 3), np.uint8)
    for i in range(count):
        _, *position_and_colour, _, track = records.take(_POINT)
        xyz[i], rgb[i] = position_and_colour[:3], position_and_colour[3:]
        records.skip(track * _TRACK_BYTES)
    records.finish()
    return Points(xyz, rgb)


class _Records:
    """A file's bytes and a position in them; nothing is read, or made room for, beyond their end."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.data = path.read_bytes()
        self.at = 0

    def take(self, layout: struct.Struct) -> tuple[Any, ...]:
        start = self.at
        self.skip(layout.size)
        return layout.unpack_from(self.data, start)

    def skip(self, size: int) -> None:
        if size > len(self.data) - self.at:
            raise self._refusal(f"{size} more bytes", f"{len(self.data) - self.at} before the end of the file")
        self.at += size

    def count(self, record_bytes: int) -> int:
        """Read a count of records that take at least `record_bytes` each."""
        count = int(self.take(_COUNT)[0])
        room = (len(self.data) - self.at) // record_bytes
        if count > room:
            raise self._refusal(f"a count of at most {room} records, as the file's size allows", str(count))
        return count

    def text(self) -> str:
        end = self.data.find(b"\0", self.at)
        try:
            text = self.data[self.at : end].decode() if end >= 0 else ""
        except UnicodeDecodeError:
            text = ""
        if not text:
            raise self._refusal("a zero-terminated UTF-8 name", repr(self.data[self.at : self.at + 20]))
        self.at = end + 1
        return text

    def finish(self) -> None:
        if self.at != len(self.data):
            raise self._refusal("the end of the file", f"{len(self.data) - self.at} more bytes")

    def _refusal(self, expected: str, found: str) -> InputError:
        return InputError(self.path, f"byte {self.at}", expected=expected, found=found)
