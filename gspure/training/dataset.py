"""Training data: views with photographs, and initial points. Everything is checked before training."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gspure.arrays import Float32, Float64, UInt8
from gspure.cameras import Camera, read_cameras, require_images, scaled, split
from gspure.cameras.camera import spread
from gspure.cameras.entry import Entry
from gspure.cameras.nerfstudio import frames_of
from gspure.cameras.photographs import (
    disambiguated_names,
    located,
    missing_photographs,
    photograph,
    photograph_size,
    require_present,
    safe_name,
)
from gspure.cameras.points import stored_points
from gspure.cameras.reading import camera_object
from gspure.cameras.worlds import mention_near, shifted
from gspure.errors import InputError
from gspure.files import digest
from gspure.images import orientation_remark, read_image, shrunk
from gspure.progress import say, warn
from gspure.training.initialization import (
    LEAST_POINTS,
    RANDOM_POINTS,
    consistent_points,
    random_points,
    view_counts,
)

EXTENT_MARGIN: Final = 1.1  # times the largest distance of a training camera from the mean of all (3DGS)
ASPECT_TOLERANCE: Final = 0.01  # relative; rounding to whole pixels stays within it, cropping and turning do not
MOST_ROUNDING: Final = 1e-5  # of float32, relative to the distance of the farthest camera from the mean; ours

_SKIP: Final = "`gspure train --skip-missing` leaves out their views"
_NAME: Final = "`gspure train --images DIR` names a folder of photographs named as the views"
_GREY: Final = 128
BLENDER: Final = "transforms_train.json"  # training views of a Blender scene (NeRF)
BLENDER_HELD_OUT: Final = ("transforms_test.json", "transforms_val.json")  # the first of these that exists
_NERFSTUDIO_HELD_OUT: Final = ("test_filenames", "val_filenames")  # the first of these lists that exists


@dataclass(frozen=True, eq=False)
class Dataset:
    """Views at training size, split into training and held-out ones, and initial points.

    Each view has a photograph. Points [P,3] are in world units, their colours 8-bit. `source` is the file or folder of
    the capture, `offset` [3] the point of its world that is the origin here. Points are random if the capture has none.
    """

    source: Path
    train: list[Camera]
    test: list[Camera]
    xyz: Float64
    rgb: UInt8
    offset: Float64
    has_random_points: bool

    @property
    def extent(self) -> float:
        """The scene's size in world units, which scales 3DGS's learning rates and thresholds."""
        return extent(self.train)

    def max_gaussians(self, pixels_per_gaussian: int) -> int:
        """Return the default bound of growth: one Gaussian per point and one per so many pixels of the largest view.

        Ours: with few points or few photographs, 3DGS's rule grows Gaussians that do not improve held-out views.
        """
        return len(self.xyz) + max(view.width * view.height for view in self.train) // pixels_per_gaussian


def read_dataset(
    source: Path, resolution: str, *, photographs: Path | None = None, skip_missing: bool = False, seed: int = 0
) -> Dataset:
    """Read views and points, and check that a model can be trained from them.

    `source` is a Blender scene's folder with its splits, or any source of `gspure.cameras.read_cameras`; without
    splits, `gspure.cameras.split` makes them. `resolution` is a rule of `gspure.cameras.scaled`. The folder
    `photographs` replaces the photographs that the source names; its files are named after the views. `skip_missing`
    leaves out views without a photograph. `seed` is that of the random points that replace missing ones. A capture far
    from the origin, such as one in UTM coordinates, is moved to it, because float32 would round its coordinates.
    """
    source = Path(source)
    views = read_views(source)
    cameras = _with_photographs(views.cameras, photographs, source)
    if skip_missing:
        cameras = _present(cameras, source)
    some_are_present = len(missing_photographs(cameras)) < len(cameras)
    require_present(cameras, source, hint=_SKIP if some_are_present else _NAME)
    shown = scaled(cameras, resolution)
    require_images(shown, source)
    _require_shapes(cameras, source)
    offset = _offset(shown)
    if offset.any():
        say(f"{source}: far from the origin: training around {' '.join(map(str, offset))}, the origin of all results")
        shown = shifted(shown, -offset)
    train, test = views.split(shown)
    if not (train and extent(train) > 0):
        places = f"{len(train)} in one place" if train else "none"
        raise InputError(source, "training views", expected="several, from different places", found=places)
    xyz, rgb, are_random = _points(source, train, seed, offset)
    if not view_counts(xyz, train).any():
        raise InputError(source, "training views", expected="some that see points", found="all look away from them")
    if not are_random:
        mention_near(xyz, train)
    return Dataset(source, train, test, xyz, rgb, offset, are_random)


class Views(NamedTuple):
    """All views of a capture, in the order of their file.

    `held_out` names the held-out ones; None if the capture has no splits, so that `gspure.cameras.split` decides.
    """

    cameras: list[Camera]
    held_out: frozenset[str] | None = None

    def split(self, cameras: list[Camera]) -> tuple[list[Camera], list[Camera]]:
        """Return the training and the held-out ones of these cameras, each sorted by name."""
        if self.held_out is None:
            return split(cameras)
        ordered = sorted(cameras, key=lambda camera: camera.name)
        train = [camera for camera in ordered if camera.name not in self.held_out]
        return train, [camera for camera in ordered if camera.name in self.held_out]


def read_views(source: Path) -> Views:
    """Read the views of a source of `gspure.cameras.read_cameras`, with the splits of a Blender or nerfstudio scene."""
    cameras = read_cameras(source)
    scene = camera_object(source)
    if scene and any(name in scene for name in _NERFSTUDIO_HELD_OUT):
        return _nerfstudio_views(scene, cameras)
    file = next((source / name for name in BLENDER_HELD_OUT if (source / name).is_file()), None)
    if not (file and scene and Path(scene.source).name == BLENDER):
        return Views(cameras)
    both = [*cameras, *read_cameras(file)]
    names = disambiguated_names([camera.name for camera in both], [str(camera.image) for camera in both], file)
    views = [replace(camera, name=name) for camera, name in zip(both, names, strict=True)]
    return Views(views, frozenset(names[len(cameras) :]))


def _nerfstudio_views(entry: Entry, cameras: list[Camera]) -> Views:
    """Return the views that the lists ``train_filenames`` and ``test_filenames`` (or val) name, as nerfstudio does."""
    key = next(name for name in _NERFSTUDIO_HELD_OUT if name in entry)
    files = (frame.text("file_path") for frame in frames_of(entry))
    views = dict(zip(files, (camera.name for camera in cameras), strict=True))
    held_out = _names(entry, key, views)
    train = {*views.values()} - held_out
    if "train_filenames" in entry:
        train = _names(entry, "train_filenames", views)
    missing = (train | held_out) - {camera.name for camera in cameras}
    if missing:
        raise entry.refusal(key, expected="views of the file", found=min(missing))
    return Views([camera for camera in cameras if camera.name in train | held_out], frozenset(held_out))


def _names(entry: Entry, key: str, views: Mapping[str, str]) -> set[str]:
    """Return the names of the views in a list of files; `views` maps files to names."""

    def is_names(value: object) -> bool:
        return isinstance(value, list) and all(isinstance(file, str) for file in value)

    return {views.get(file) or safe_name(file) for file in entry.value(key, "a list of file names", is_names)}


def extent(cameras: Sequence[Camera]) -> float:
    """Return 1.1 times the largest distance of a camera from the mean of all."""
    return EXTENT_MARGIN * spread(cameras)


def read_photographs(cameras: Iterable[Camera], background: Sequence[float] = (0.0, 0.0, 0.0)) -> list[Float32]:
    """Read the photograph [H,W,3] of each view at the view's size, transparent ones on the background."""
    return [read_image(photograph(camera), (camera.width, camera.height), background) for camera in cameras]


def reduced(
    views: Sequence[Camera], images: Sequence[Float32], factor: int
) -> tuple[Sequence[Camera], Sequence[Float32]]:
    """Return views and their images [H,W,3] with sides divided by a factor and rounded; see `shrunk`."""
    if factor == 1:
        return views, images
    smaller = [view.resized(max(1, round(view.width / factor)), max(1, round(view.height / factor))) for view in views]
    sizes = ((view.width, view.height) for view in smaller)
    return smaller, [shrunk(image, size) for image, size in zip(images, sizes, strict=True)]


def with_agreed_points(dataset: Dataset, images: Sequence[Float32], seed: int) -> Dataset:
    """Return the dataset with points that the training images agree on, in place of random ones."""
    if not dataset.has_random_points:
        return dataset
    rng = np.random.default_rng(seed)
    xyz, rgb = consistent_points(dataset.train, images, dataset.extent, rng)
    return replace(dataset, xyz=xyz, rgb=rgb) if len(xyz) >= LEAST_POINTS else dataset


def fingerprint(dataset: Dataset, images: Sequence[Float32]) -> str:
    """Return a digest of all training data."""
    return digest(dataset.xyz, dataset.rgb, *(camera.numbers for camera in dataset.train), *images)


def _present(cameras: Sequence[Camera], source: Path) -> list[Camera]:
    """Return the views with a photograph, and report the others; all if none has one, which are refused later."""
    present = [camera for camera in cameras if not missing_photographs([camera])]
    if len(present) < len(cameras):
        missing = ", ".join(missing_photographs(cameras))
        say(f"{source}: {len(cameras) - len(present)} of {len(cameras)} views left out, photographs missing: {missing}")
    return present or [*cameras]


def _with_photographs(cameras: list[Camera], photographs: Path | None, source: Path) -> list[Camera]:
    """Return the cameras of `source` with the photographs of the same names in the folder `photographs`.

    Without a folder, the photographs are located in the capture.
    """
    if photographs is None:
        folder = source if source.is_dir() else source.parent
        images = located([c.name for c in cameras], [c.image for c in cameras], folder)
        return [replace(c, image=image) for c, image in zip(cameras, images, strict=True)]
    named: dict[str, Path] = {}
    views = {camera.name for camera in cameras}
    files = sorted(path for path in photographs.rglob("*") if path.is_file())
    below = [file.relative_to(photographs).as_posix() for file in files]
    names = [safe_name(path) for path in below]
    apart = names if views <= {*names} else disambiguated_names(names, below, photographs)
    for file, shared_name, distinct_name in zip(files, names, apart, strict=True):
        name = shared_name if shared_name in views else distinct_name
        if name not in views:
            continue
        first = named.setdefault(name, file)
        if first != file:
            raise InputError(photographs, name, expected="one photograph", found=f"{first.name} and {file.name}")
    return [replace(c, image=named.get(c.name, photographs / c.name)) for c in cameras]


def _require_shapes(cameras: Sequence[Camera], source: Path) -> None:
    """Refuse photographs whose aspect ratio differs from that of their camera, such as cropped or turned ones.

    Warn about EXIF orientations.
    """
    remarks = []
    for camera in cameras:
        file = photograph(camera)
        width, height = photograph_size(file)
        hint = orientation_remark(file)
        if hint:
            remarks.append(f"{camera.name}: {hint}")
        if abs(width * camera.height / (height * camera.width) - 1) > ASPECT_TOLERANCE:
            expected = f"the shape of its camera, {camera.width}x{camera.height}"
            raise InputError(source, f"{camera.name}.image", expected=expected, found=f"{width}x{height}", hint=hint)
    if remarks:
        warn(f"{source}: {len(remarks)} of {len(cameras)} photographs are turned, such as {remarks[0]}")


def _offset(cameras: Sequence[Camera]) -> Float64:
    """Return a point amid the cameras if they are so far from the origin that float32 rounds, else the origin."""
    centres = np.array([camera.centre for camera in cameras])
    size = spread(cameras)
    if not np.spacing(np.abs(centres).max().astype(np.float32)) > MOST_ROUNDING * size > 0:
        return np.zeros(3)
    return np.asarray(np.round(centres.mean(axis=0), max(0, -math.floor(math.log10(size)))))


def _points(source: Path, train: Sequence[Camera], seed: int, offset: Float64) -> tuple[Float64, UInt8, bool]:
    """Return the stored points around `offset`, or random grey ones if fewer than `LEAST_POINTS` are stored.

    Tell whether they are random.
    """
    xyz, rgb = stored_points(source)
    if len(xyz) >= LEAST_POINTS:
        return xyz - offset, rgb, False
    xyz = random_points(train, extent(train), RANDOM_POINTS, np.random.default_rng(seed))
    if len(xyz) < LEAST_POINTS:
        expected = f"overlapping ones, or at least {LEAST_POINTS} points"
        raise InputError(source, "training views", expected=expected, found="neither")
    say(f"{source} has fewer than {LEAST_POINTS} points: training starts from {len(xyz)} random ones")
    return xyz, np.full(xyz.shape, _GREY, np.uint8), True
