"""COLMAP sparse models: cameras, images and points3D, binary or text.

Axes and pixel convention are those of `gspure.cameras.camera.Camera`. All camera models are read but those of fisheye
lenses. Binary files are little-endian: a 64-bit count, then records without padding. Text files have a record per line,
images on two lines, and comments after ``#``. Source: https://colmap.github.io/format.html and
https://colmap.github.io/cameras.html.
"""

import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from gspure.cameras.camera import COEFFICIENTS, Camera, intrinsics
from gspure.cameras.entry import Entry
from gspure.cameras.photographs import distinct, located, view_names
from gspure.errors import InputError, reading
from gspure.files import Float64, UInt8
from gspure.model.ply import require_coordinates
from gspure.model.rotations import rotation_matrices
from gspure.progress import warn

Record = TypeVar("Record")

_SUFFIXES: Final = (".bin", ".txt")

_PARAMETERS: Final = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "OPENCV_FISHEYE": (),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
}
"""Parameters of the camera models, in the order of their numbers in binary files; fisheye lenses are not read."""

_HINT: Final = (
    "undistort first: colmap image_undistorter --image_path PHOTOS --input_path SPARSE --output_path UNDISTORTED"
)


class Points(NamedTuple):
    """The sparse point cloud: positions [P,3] in world units and 8-bit colours [P,3]."""

    xyz: Float64
    rgb: UInt8


def find_sparse(folder: Path) -> Path | None:
    """Return the folder with cameras.bin or cameras.txt: `folder`, its ``sparse/0`` or its ``sparse``; else None."""
    candidates = (folder, folder / "sparse" / "0", folder / "sparse")
    return next((path for path in candidates if any((path / f"cameras{s}").is_file() for s in _SUFFIXES)), None)


def read_colmap(folder: Path) -> list[Camera]:
    """Read the cameras of a sparse model, in the order of its images file.

    `folder` is the project's root, its ``sparse/0``, or the folder of the files. Photographs are in the nearest
    ``images`` folder beside or above the files. Raise `InputError` if a file is missing, truncated or malformed, or a
    camera has a fisheye lens.
    """
    cameras_file, images_file = _file(folder, "cameras"), _file(folder, "images")
    optics: dict[int, dict[str, Any]] = {}
    with reading(cameras_file, "cameras of a COLMAP sparse model"):
        for number, lens in _lenses(cameras_file):
            if number in optics:
                raise InputError(cameras_file, lens.where, expected="one of this number", found="a second one")
            optics[number] = _optics(lens)
    above = images_file.absolute().parents[:3]
    photographs = next((parent / "images" for parent in above if (parent / "images").is_dir()), None)
    with reading(images_file, "images of a COLMAP sparse model"):
        poses = [*_poses(images_file)]
    _mention_larger(images_file)
    files, names = [pose.text("name") for pose in poses], view_names(poses, "name")
    images = located(files, [photographs and photographs / file for file in files], images_file.parent)
    views = zip(poses, names, images, strict=True)
    return distinct([_camera(pose, optics, name, image) for pose, name, image in views], images_file)


def _mention_larger(images_file: Path) -> None:
    """Warn if another model of the same photographs, which COLMAP writes beside this one, is larger."""
    sparse = images_file.parent
    beside = sparse.parent.glob(f"*/{images_file.name}") if sparse.name.isdigit() else ()
    larger = max(beside, key=lambda path: path.stat().st_size, default=images_file)
    if larger.stat().st_size > images_file.stat().st_size:
        warn(f"{sparse}: {larger.parent} holds a larger model: name that folder to read it instead")


def read_points(folder: Path) -> Points:
    """Read the sparse point cloud, without errors and tracks."""
    path = _file(folder, "points3D")
    with reading(path, "points of a COLMAP sparse model"):
        points = [*_points(path)]
    xyz = np.array([point[:3] for point in points], np.float64).reshape(-1, 3)
    require_coordinates(path, xyz)
    return Points(xyz, np.array([point[3:] for point in points], np.uint8).reshape(-1, 3))


def _file(folder: Path, stem: str) -> Path:
    sparse = find_sparse(folder) or folder
    for suffix in _SUFFIXES:
        if (path := sparse / f"{stem}{suffix}").is_file():
            return path
    raise InputError(sparse, stem, expected=f"{stem}.bin or {stem}.txt of a COLMAP sparse model", found="neither")


def _optics(lens: Entry) -> dict[str, Any]:
    """Return the fields of a `Camera` that a lens determines."""
    fx, fy = (lens.positive("f" if "f" in lens else key) for key in ("fx", "fy"))
    K = intrinsics(fx, fy, lens.number("cx"), lens.number("cy"))
    size = {"width": lens.pixels("width"), "height": lens.pixels("height")}
    return {**size, "K": K, "distortion": lens.distortion(COEFFICIENTS)}


def _camera(pose: Entry, optics: dict[int, dict[str, Any]], name: str, image: Path | None) -> Camera:
    number = pose.value("camera_id", "a camera of the file of cameras", lambda value: value in optics)
    quat = pose.array("quat", (4,))
    if not np.linalg.norm(quat) > 0:
        raise pose.refusal("quat", expected="a rotation", found=" ".join(map(str, quat)))
    viewmat = np.eye(4)
    viewmat[:3, :3] = rotation_matrices(quat[None])[0]
    viewmat[:3, 3] = pose.array("translation", (3,))
    return Camera(name=name, viewmat=viewmat, image=image, **optics[number])


def _lenses(path: Path) -> Iterator[tuple[int, Entry]]:
    """Yield number and values of each camera of cameras.bin or cameras.txt."""

    def lens(camera_id: int, model: str, width: int, height: int, numbers: Iterable[float]) -> tuple[int, Entry]:
        parameters = dict(zip(_parameters(path, camera_id, model), numbers, strict=True))
        return camera_id, Entry(path, f"camera {camera_id}", {"width": width, "height": height, **parameters})

    def from_text(line: str) -> tuple[int, Entry]:
        camera_id, model, width, height, *numbers = line.split()
        return lens(int(camera_id), model, int(width), int(height), map(float, numbers))

    if path.suffix == ".txt":
        yield from _from_lines(path, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]", from_text)
        return
    for records in _records(path):
        camera_id, number, width, height = records.take("<iiQQ")
        model = dict(enumerate(_PARAMETERS)).get(number, f"model {number}")
        count = len(_parameters(path, camera_id, model))
        yield lens(camera_id, model, width, height, records.take(f"<{count}d"))


def _poses(path: Path) -> Iterator[Entry]:
    """Yield the values of each image of images.bin or images.txt, without the 2-D points."""

    def pose(image_id: int, numbers: Sequence[float], camera_id: int, name: str) -> Entry:
        values = {"quat": numbers[:4], "translation": numbers[4:], "camera_id": camera_id, "name": name}
        return Entry(path, f"image {image_id}", values)

    def from_text(line: str) -> Entry:
        image_id, *numbers, camera_id, name = line.split(maxsplit=9)
        return pose(int(image_id), [*map(float, numbers)], int(camera_id), name)

    if path.suffix == ".txt":
        lines = _lines(path)
        for number, line in lines:
            if line:
                yield _parsed(path, number, line, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME", from_text)
                below = next(lines, (number + 1, ""))
                _parsed(path, *below, "the 2-D points as X Y POINT3D_ID (the line may be empty)", _points_2d)
        return
    for records in _records(path):
        image_id, *numbers, camera_id = records.take("<i7di")
        name = records.text()
        (points,) = records.take("<Q")
        records.at += 24 * points  # x, y, point id of a 2-D point each
        yield pose(image_id, numbers, camera_id, name)


def _points_2d(line: str) -> None:
    if len(line.split()) % 3:
        raise ValueError


def _points(path: Path) -> Iterator[tuple[float, ...]]:
    """Read x, y, z, r, g, b of points3D.bin or points3D.txt."""

    def point(line: str) -> tuple[float, ...]:
        _, x, y, z, r, g, b, _, *_ = line.split()
        return float(x), float(y), float(z), *bytes(map(int, (r, g, b)))

    if path.suffix == ".txt":
        yield from _from_lines(path, "POINT3D_ID X Y Z R G B ERROR TRACK[]", point)
        return
    for records in _records(path):
        _, *values, _, track = records.take("<Q3d3BdQ")
        records.at += 8 * track  # of image id and index of the 2-D point each
        yield tuple(values)


def _parameters(path: Path, camera_id: object, model: str) -> tuple[str, ...]:
    """Return the names of a camera model's parameters; a fisheye model is refused."""
    if names := _PARAMETERS.get(model):
        return names
    expected = f"one of {', '.join(name for name, names in _PARAMETERS.items() if names)}"
    raise InputError(path, f"camera {camera_id}.model", expected=expected, found=model, hint=_HINT)


class _Records:
    """A binary file's bytes and a position in them."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def take(self, layout: str) -> tuple[Any, ...]:
        values = struct.unpack_from(layout, self.data, self.at)
        self.at += struct.calcsize(layout)
        return values

    def text(self) -> str:
        """Read a name, which ends with a zero."""
        start, self.at = self.at, self.data.index(b"\0", self.at) + 1
        return self.data[start : self.at - 1].decode(errors="replace")


def _records(path: Path) -> Iterator[_Records]:
    """Yield a binary file as often as it has records, each time at the next one; the file must end after the last."""
    records = _Records(path.read_bytes())
    for _ in range(records.take("<Q")[0]):
        yield records
    if records.at != len(records.data):
        raise ValueError(f"{len(records.data)} bytes, not {records.at}")


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Return (line number, stripped line) of all lines but comments."""
    lines = enumerate(map(str.strip, path.read_text(encoding="utf-8-sig").splitlines()), start=1)
    return ((number, line) for number, line in lines if not line.startswith("#"))


def _from_lines(path: Path, expected: str, parse: Callable[[str], Record]) -> Iterator[Record]:
    return (_parsed(path, number, line, expected, parse) for number, line in _lines(path) if line)


def _parsed(path: Path, number: int, line: str, expected: str, parse: Callable[[str], Record]) -> Record:
    """Return the record of a line; refuse a line whose fields are not as expected."""
    try:
        return parse(line)
    except InputError:
        raise
    except ValueError:
        raise InputError(path, f"line {number}", expected=expected, found=line[:60] or "nothing") from None
