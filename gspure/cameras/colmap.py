"""COLMAP sparse models: cameras, images and points3D, binary or text.

Axes and pixel convention are those of `gspure.cameras.camera.Camera`. All camera models but fisheye lenses are read.
Binary files are little-endian: a 64-bit count, then records without padding. Text files have one record per line and
comments after ``#``; a line of 2-D points may follow an image. Source: https://colmap.github.io/format.html and
https://colmap.github.io/cameras.html.
"""

import operator
import re
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.arrays import Float32, Float64, UInt8
from gspure.cameras.camera import Camera, intrinsics, rigid
from gspure.cameras.entry import Entry, with_finite_poses
from gspure.cameras.photographs import located, view_names
from gspure.errors import InputError, reading
from gspure.files import write_text
from gspure.images import write_image
from gspure.model.ply import require_coordinates
from gspure.model.rotations import rotation_matrices
from gspure.progress import warn

Record = tuple[Any, ...]

_MASKS: Final = ("masks", "mask")

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

_POINT: Final = re.compile(r"(([-+.\de]+|nan) ){2}(-1|\d+)$|$", re.IGNORECASE)
_COUNT: Final = re.compile(r"# *Number of images: *(\d+)")

_HINT: Final = "undistort first: colmap image_undistorter --image_path DIR --input_path SPARSE --output_path OUT"


def find_sparse(folder: Path) -> Path | None:
    """Return the folder with cameras.bin or cameras.txt: `folder`, its ``sparse/0`` or its ``sparse``; else None."""
    for candidate in (folder, folder / "sparse" / "0", folder / "sparse"):
        if any((candidate / f"cameras{suffix}").is_file() for suffix in _SUFFIXES):
            return candidate
    return None


def read_colmap(folder: Path) -> list[Camera]:
    """Read the cameras of a sparse model, in the order of its images file.

    `folder` is the project's root, its ``sparse/0``, or the folder of the files. Photographs are in the nearest
    ``images`` folder beside or above the files.
    """
    cameras_file = _file(folder, "cameras")
    images_file = _file(folder, "images")
    with reading(cameras_file, "cameras of a COLMAP sparse model"):
        optics = dict(_optics(cameras_file))
    with reading(images_file, "images of a COLMAP sparse model"):
        stored = [_pose(images_file, *image) for image in _images(images_file)]
    poses = with_finite_poses(stored, "name", "quat", "translation")
    _mention_larger(images_file)
    above = images_file.absolute().parents[:3]
    photographs = next(filter(Path.is_dir, (folder / "images" for folder in above)), None)
    masks = next(filter(Path.is_dir, (folder / name for folder in above for name in _MASKS)), None)
    if masks:
        warn(f"{masks}: masks are not used: masked pixels count in training and metrics")
    files = [pose.text("name") for pose in poses]
    names = view_names(poses, "name", images_file)
    expected_images = [photographs / file if photographs else None for file in files]
    images = located(files, expected_images, images_file.parent)
    views = zip(poses, names, images, strict=True)
    return [_camera(pose, optics, name, image) for pose, name, image in views]


def _mention_larger(images_file: Path) -> None:
    """Warn if a larger model of the same photographs lies beside this one; COLMAP may write several."""
    sparse = images_file.parent
    siblings = sparse.parent.glob(f"*/{images_file.name}") if sparse.name.isdigit() else ()
    largest = max(siblings, key=lambda path: path.stat().st_size, default=images_file)
    if largest.stat().st_size > images_file.stat().st_size:
        warn(f"{sparse}: {largest.parent} holds a larger model: name that folder to read it instead")


def read_points(folder: Path) -> tuple[Float64, UInt8]:
    """Read the sparse point cloud: positions [P,3] in world units and 8-bit colours [P,3]."""
    path = _file(folder, "points3D")
    with reading(path, "points of a COLMAP sparse model"):
        points = [*_points(path)]
    xyz = np.array([point[:3] for point in points], np.float64).reshape(-1, 3)
    require_coordinates(path, xyz)
    return xyz, np.array([point[3:] for point in points], np.uint8).reshape(-1, 3)


def write_colmap(
    folder: Path, views: Sequence[Camera], images: Iterable[Float32], points: tuple[Float64, UInt8]
) -> None:
    """Write a project: images ``images/00000.png`` and so on, one per view, and ``sparse/0`` as text.

    `images` are [H,W,3], `points` positions [P,3] and 8-bit colours [P,3].
    """
    from scipy.spatial.transform import Rotation

    camera_lines = []
    image_lines = []
    for number, (view, image) in enumerate(zip(views, images, strict=True)):
        write_image(folder / "images" / f"{number:05d}.png", image)
        quat = Rotation.from_matrix(view.viewmat[:3, :3]).as_quat(scalar_first=True)
        lens = view.numbers[2:6]
        camera_lines.append(f"{number + 1} PINHOLE {view.width} {view.height} {_numbers(lens)}\n")
        pose = _numbers([*quat, *view.viewmat[:3, 3]])
        image_lines.append(f"{number + 1} {pose} {number + 1} {number:05d}.png\n\n")
    numbered_points = enumerate(zip(*points, strict=True), 1)
    point_lines = (f"{number} {_numbers(xyz)} {_numbers(rgb)} 0\n" for number, (xyz, rgb) in numbered_points)
    for name, lines in {"cameras": camera_lines, "images": image_lines, "points3D": point_lines}.items():
        write_text(folder / "sparse" / "0" / f"{name}.txt", "".join(lines))


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def _file(folder: Path, stem: str) -> Path:
    sparse = find_sparse(folder) or folder
    for suffix in _SUFFIXES:
        path = sparse / f"{stem}{suffix}"
        if path.is_file():
            return path
    raise InputError(sparse, stem, expected=f"{stem}.bin or {stem}.txt of a COLMAP sparse model", found="neither")


def _pose(path: Path, number: int, *values: Any) -> Entry:
    *pose, camera, name = values
    content = {"quat": pose[:4], "translation": pose[4:], "camera_id": camera, "name": name}
    return Entry(path, f"image {number}", content)


def _camera(pose: Entry, optics: dict[int, dict[str, Any]], name: str, image: Path | None) -> Camera:
    number = pose.value("camera_id", "a camera of the file of cameras", lambda value: value in optics)
    quat = pose.array("quat", (4,))
    if not np.linalg.norm(quat) > 0:
        raise pose.refusal("quat", expected="a rotation", found=" ".join(map(str, quat)))
    viewmat = rigid(rotation_matrices(quat[None])[0], pose.array("translation", (3,)))
    return Camera(name=name, viewmat=viewmat, image=image, **optics[number])


def _optics(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield the number of each camera of a file, and the fields of a `Camera` that it determines."""
    for number, model, width, height, *values in _lenses(path):
        names = _PARAMETERS.get(model)
        if not names:
            expected = f"one of {', '.join(name for name, names in _PARAMETERS.items() if names)}"
            raise InputError(path, f"camera {number}.model", expected=expected, found=model, hint=_HINT)
        parameters = dict(zip(names, values, strict=True))
        lens = Entry(path, f"camera {number}", {"width": width, "height": height, **parameters})
        fx = lens.positive("f" if "f" in lens else "fx")
        fy = lens.positive("f" if "f" in lens else "fy")
        fields = {
            "K": intrinsics(fx, fy, lens.number("cx"), lens.number("cy")),
            "width": lens.pixels("width"),
            "height": lens.pixels("height"),
            "distortion": lens.distortion(),
        }
        yield number, fields


def _lenses(path: Path) -> Iterator[Record]:
    """Yield number, model, width, height and parameters of each camera, without parameters for unsupported models."""

    def parsed(line: str) -> Record:
        number, model, width, height, *values = line.split()
        return int(number), model, int(width), int(height), *map(float, values)

    if path.suffix == ".txt":
        yield from _from_text(path, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]", parsed)
        return
    for reader in _records(path):
        number, model_id, width, height = reader.take("<iiQQ")
        model = dict(enumerate(_PARAMETERS)).get(model_id, f"model {model_id}")
        yield number, model, width, height, *reader.take(f"<{len(_PARAMETERS.get(model, ()))}d")


def _images(path: Path) -> Iterator[Record]:
    """Yield number, quaternion, translation, camera and name of each image, without its 2-D points."""

    def parsed(line: str) -> Record:
        number, *values, camera, name = line.split(maxsplit=9)
        return int(number), *map(float, values), int(camera), name

    if path.suffix == ".txt":
        expected = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, or 2-D points as X Y POINT3D_ID"
        yield from _from_text(path, expected, parsed, skips=_is_points)
        return
    for reader in _records(path):
        pose = reader.take("<i7di")
        name = reader.text()
        (points,) = reader.take("<Q")
        reader.position += 24 * points  # x, y, point id of a 2-D point each
        yield *pose, name


def _points(path: Path) -> Iterator[Record]:
    """Yield x, y, z, r, g, b of each point."""

    def parsed(line: str) -> Record:
        _, x, y, z, r, g, b, _, *_ = line.split()
        return float(x), float(y), float(z), *bytes(map(int, (r, g, b)))

    if path.suffix == ".txt":
        yield from _from_text(path, "POINT3D_ID X Y Z R G B ERROR TRACK[]", parsed)
        return
    for reader in _records(path):
        _, *point, _, track = reader.take("<Q3d3BdQ")
        reader.position += 8 * track  # image id and index of the 2-D point each
        yield tuple(point)


class _Reader:
    """The bytes of a binary file, and a position in them."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.position = 0

    def take(self, layout: str) -> Record:
        if self.position + struct.calcsize(layout) > len(self.data):
            raise ValueError(f"{len(self.data)} bytes: cut short, or another file")
        values = struct.unpack_from(layout, self.data, self.position)
        self.position += struct.calcsize(layout)
        return values

    def text(self) -> str:
        """Read a name, which ends with a zero."""
        end = self.data.index(b"\0", self.position)
        name = self.data[self.position : end].decode(errors="replace")
        self.position = end + 1
        return name


def _records(path: Path) -> Iterator[_Reader]:
    """Yield one reader of a binary file once per record, for the caller to read it; require the end after the last."""
    reader = _Reader(path.read_bytes())
    for _ in range(reader.take("<Q")[0]):
        yield reader
    if reader.position != len(reader.data):
        raise ValueError(f"{len(reader.data)} bytes, not {reader.position}")


def _is_points(line: str) -> bool:
    """Return whether a line of an images file holds 2-D points, X Y POINT3D_ID each, by the first and the last one."""
    fields = line.split()
    ends = (fields[:3], fields[-3:])
    return len(fields) % 3 == 0 and all(_POINT.match(" ".join(end)) for end in ends)


def _from_text(
    path: Path, expected: str, parse: Callable[[str], Record], skips: Callable[[str], bool] = operator.not_
) -> Iterator[Record]:
    """Yield the record of each line, without comments and those that `skips` accepts, by default empty ones.

    Warn if the header counts another number of images.
    """
    counted = None
    total = 0
    for number, line in enumerate(map(str.strip, path.read_text(encoding="utf-8-sig").splitlines()), start=1):
        if line.startswith("#"):
            counted = _COUNT.match(line) or counted
        if line.startswith("#") or skips(line):
            continue
        try:
            yield parse(line)
        except ValueError:
            raise InputError(path, f"line {number}", expected=expected, found=line[:60]) from None
        total += 1
    if counted and int(counted[1]) != total:
        warn(f"{path}: {total} images, but its header counts {counted[1]}")
