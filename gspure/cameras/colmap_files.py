"""The files of COLMAP sparse models: cameras, images and points3D, binary or text.

Binary files are little-endian: a 64-bit count, then records without padding. Text files have a record per line, images
on two lines, and comments after ``#``; their header counts the records. Source: https://colmap.github.io/format.html
and https://colmap.github.io/cameras.html.
"""

import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gspure.errors import InputError, reading
from gspure.files import Float64, UInt8
from gspure.progress import warn

_PARAMETERS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "OPENCV_FISHEYE": None,
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
}
"""Parameters of the camera models, in the order of their numbers in binary files; fisheye lenses are not read."""

_HINT = "undistort first: colmap image_undistorter --image_path PHOTOS --input_path SPARSE --output_path UNDISTORTED"

_COUNT = struct.Struct("<Q")
_LENS = struct.Struct("<iiQQ")  # camera id, model, width, height; parameters follow
_POSE = struct.Struct("<i7di")  # image id, quaternion, translation, camera id; name and 2-D points follow
_POINT = struct.Struct("<Q3d3BdQ")  # point id, xyz, rgb, error, track length; the track follows
_POINT_2D_BYTES = 24  # x, y, point id
_TRACK_BYTES = 8  # image id, index of the 2-D point


class Lens(NamedTuple):
    """Intrinsics, shared by one or more images."""

    camera_id: int
    width: int
    height: int
    parameters: dict[str, float]


class Pose(NamedTuple):
    """An image: `quat` (w, x, y, z) and `translation` map world to camera."""

    image_id: int
    quat: tuple[float, ...]
    translation: tuple[float, ...]
    camera_id: int
    name: str


class Points(NamedTuple):
    """The sparse point cloud: positions [P,3] in world units and 8-bit colours [P,3]."""

    xyz: Float64
    rgb: UInt8


def read_lenses_file(path: Path) -> list[Lens]:
    """Read cameras.bin or cameras.txt."""
    lenses = []
    if path.suffix == ".bin":
        records = _Records(path)
        for _ in range(records.count(_LENS.size)):
            camera_id, number, width, height = records.take(_LENS)
            model = [*_PARAMETERS][number] if 0 <= number < len(_PARAMETERS) else f"model {number}"
            names = _parameters(path, camera_id, model)
            values = records.take(struct.Struct(f"<{len(names)}d"))
            lenses.append(Lens(camera_id, width, height, dict(zip(names, values, strict=True))))
        records.finish()
        return lenses
    for number, line in _lines(path):
        with _fields(path, number, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]", line):
            camera_id, model, width, height, *numbers = line.split()
            names = _parameters(path, int(camera_id), model)
            parameters = dict(zip(names, map(float, numbers), strict=True))
            lenses.append(Lens(int(camera_id), int(width), int(height), parameters))
    return _counted(path, lenses)


def read_poses_file(path: Path) -> list[Pose]:
    """Read images.bin or images.txt, without the 2-D points."""
    poses = []
    if path.suffix == ".bin":
        records = _Records(path)
        for _ in range(records.count(_POSE.size + 1 + _COUNT.size)):
            image_id, *numbers, camera_id = records.take(_POSE)
            name = records.text()
            records.skip(records.count(_POINT_2D_BYTES) * _POINT_2D_BYTES)
            poses.append(Pose(image_id, tuple(numbers[:4]), tuple(numbers[4:]), camera_id, name))
        records.finish()
        return poses
    lines = _lines(path, empty=True)
    for number, line in lines:
        if not line:
            continue
        with _fields(path, number, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME", line):
            image_id, *texts, camera, name = line.split(maxsplit=9)
            values = tuple(map(float, texts))
            poses.append(Pose(int(image_id), values[:4], values[4:], int(camera), name))
        number, line = next(lines, (number + 1, ""))  # noqa: PLW2901
        with _fields(path, number, "the image's 2-D points as X Y POINT3D_ID (the line may be empty)", line):
            if len(line.split()) % 3:
                raise ValueError
    return _counted(path, poses)


def read_points_file(path: Path) -> Points:
    """Read points3D.bin or points3D.txt, without errors and tracks."""
    if path.suffix == ".bin":
        records = _Records(path)
        count = records.count(_POINT.size)
        xyz, rgb = np.empty((count, 3)), np.empty((count, 3), np.uint8)
        for i in range(count):
            _, *position_and_colour, _, track = records.take(_POINT)
            xyz[i], rgb[i] = position_and_colour[:3], position_and_colour[3:]
            records.skip(track * _TRACK_BYTES)
        records.finish()
        return Points(xyz, rgb)
    points = []
    for number, line in _lines(path):
        with _fields(path, number, "POINT3D_ID X Y Z R G B ERROR TRACK[]", line):
            _, x, y, z, r, g, b, _, *_ = line.split()
            points.append((float(x), float(y), float(z), *bytes(map(int, (r, g, b)))))
    table = np.array(_counted(path, points)).reshape(-1, 6)
    return Points(table[:, :3], table[:, 3:].astype(np.uint8))


def _parameters(path: Path, camera_id: int, model: str) -> tuple[str, ...]:
    """Return the names of a camera model's parameters; a fisheye model is refused."""
    if names := _PARAMETERS.get(model):
        return names
    expected = f"one of {', '.join(name for name, names in _PARAMETERS.items() if names)}"
    raise InputError(path, f"camera {camera_id}.model", expected=expected, found=model, hint=_HINT)


class _Records:
    """A file's bytes and a position in them; nothing is read, or made room for, beyond their end."""

    def __init__(self, path: Path) -> None:
        self.path, self.data, self.at = path, path.read_bytes(), 0

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
        """Read a name, which ends with a zero."""
        name, zero, _ = self.data[self.at : self.at + (1 << 16)].partition(b"\0")
        if not zero:
            raise self._refusal("a zero-terminated name", repr(name[:20]))
        self.at += len(name) + 1
        return name.decode(errors="replace")

    def finish(self) -> None:
        if self.at != len(self.data):
            raise self._refusal("the end of the file", f"{len(self.data) - self.at} more bytes")

    def _refusal(self, expected: str, found: str) -> InputError:
        return InputError(self.path, f"byte {self.at}", expected=expected, found=found)


def _lines(path: Path, *, empty: bool = False) -> Iterator[tuple[int, str]]:
    """Yield (line number, stripped line) without comments, and without lines that are `empty` unless they count."""
    with reading(path, "UTF-8 text"):
        text = path.read_text(encoding="utf-8-sig")
    lines = ((number, line.strip()) for number, line in enumerate(text.splitlines(), start=1))
    return ((number, line) for number, line in lines if not line.startswith("#") and (line or empty))


@contextmanager
def _fields(path: Path, number: int, expected: str, line: str) -> Iterator[None]:
    """Refuse a line whose fields are not as expected."""
    try:
        yield
    except InputError:
        raise
    except ValueError:
        raise InputError(path, f"line {number}", expected=expected, found=line[:60] or "nothing") from None


def _counted(path: Path, records: list[Any]) -> list[Any]:
    """Return the records of a text file; warn if its header counts more, as it may be cut at the end of a line."""
    head = re.search(r"^# Number of (\w+): (\d{1,9})", path.read_text(encoding="utf-8-sig"), re.MULTILINE)
    if head and int(head[2]) > len(records):
        warn(f"{path} has {len(records)} {head[1]}, but its header counts {head[2]}: it may be truncated")
    return records
