"""Training views and held-out views of a capture."""

from pathlib import Path
from typing import Final, NamedTuple

from gspure.cameras import Camera, read_cameras, split
from gspure.cameras.entry import Entry
from gspure.cameras.naming import distinct, safe_name
from gspure.cameras.reading import camera_object

BLENDER: Final = "transforms_train.json"  # training views of a Blender scene (NeRF)
BLENDER_HELD_OUT: Final = ("transforms_test.json", "transforms_val.json")  # the first of these that exists
_NERFSTUDIO_HELD_OUT: Final = ("test_filenames", "val_filenames")  # the first of these lists that exists


class Views(NamedTuple):
    """All views of a capture, in the order of their file.

    `held_out` names the held-out ones; None if the capture does not define them and `gspure.cameras.split` decides.
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
    """Read the views of any source of `gspure.cameras.read_cameras`, with the splits of a Blender or nerfstudio scene.

    Raise `InputError` if a camera file is unreadable, two views share a name, or a split lists no view.
    """
    cameras, scene = read_cameras(source), camera_object(source)
    if scene and any(name in scene for name in _NERFSTUDIO_HELD_OUT):
        return _nerfstudio_views(scene, cameras)
    if not (source.is_dir() and scene and Path(scene.source).name == BLENDER):
        return Views(cameras)
    file = next((source / name for name in BLENDER_HELD_OUT if (source / name).is_file()), None)
    if file is None:
        return Views(cameras)
    held_out = read_cameras(file)
    return Views(distinct([*cameras, *held_out], file), frozenset(camera.name for camera in held_out))


def _nerfstudio_views(entry: Entry, cameras: list[Camera]) -> Views:
    """Return the views that the lists ``train_filenames`` and ``test_filenames`` (or val) name, as nerfstudio does."""
    key = next(name for name in _NERFSTUDIO_HELD_OUT if name in entry)
    held_out = _names(entry, key)
    train = _names(entry, "train_filenames") if "train_filenames" in entry else {c.name for c in cameras} - held_out
    if missing := (train | held_out) - {camera.name for camera in cameras}:
        raise entry.refusal(key, expected="views of the file", found=min(missing))
    if both := train & held_out:
        raise entry.refusal(key, expected="no training views", found=min(both))
    return Views([camera for camera in cameras if camera.name in train | held_out], frozenset(held_out))


def _names(entry: Entry, key: str) -> set[str]:
    files = entry.raw(key, "a list of file names")
    if not isinstance(files, list) or not all(isinstance(file, str) for file in files):
        raise entry.refusal(key, expected="a list of file names", found=type(files).__name__)
    return {safe_name(file) for file in files}
