"""Training views and held-out views of a capture."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

from gspure.cameras import Camera, read_cameras, split
from gspure.cameras.colmap import find_sparse
from gspure.cameras.naming import distinct
from gspure.cameras.reading import camera_file

BLENDER: Final = "transforms_train.json"
"""Training views of a Blender scene (NeRF)."""

BLENDER_HELD_OUT: Final = ("transforms_test.json", "transforms_val.json")
"""Its held-out views: the first of these that exists."""


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
    """Read the views of any source of `gspure.cameras.read_cameras`, with all splits of a Blender scene.

    Raise `InputError` if a camera file is unreadable, or two views share a name.
    """
    cameras = read_cameras(source)
    if not source.is_dir() or find_sparse(source) or camera_file(source).name != BLENDER:
        return Views(cameras)
    file = next((source / name for name in BLENDER_HELD_OUT if (source / name).is_file()), None)
    if file is None:
        return Views(cameras)
    held_out = read_cameras(file)
    return Views(distinct([*cameras, *held_out], file), frozenset(camera.name for camera in held_out))
