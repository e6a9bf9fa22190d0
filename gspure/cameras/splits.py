"""Splits of the views into training and held-out views."""

from collections.abc import Sequence
from pathlib import Path

from gspure.cameras.camera import Camera
from gspure.cameras.reading import read_cameras
from gspure.constants import TEST_EVERY
from gspure.errors import InputError


def split(cameras: Sequence[Camera]) -> tuple[list[Camera], list[Camera]]:
    """Return (train, test): of the cameras sorted by name, every eighth from the first on is a test view (3DGS --eval).

    Both are in the order of their names.
    """
    ordered = sorted(cameras, key=lambda camera: camera.name)
    train = [camera for i, camera in enumerate(ordered) if i % TEST_EVERY]
    return train, ordered[::TEST_EVERY]


def read_split(cameras: Path, name: str) -> list[Camera]:
    """Read the views of a split, ``train``, ``test`` or ``all``, in the order of their names."""
    return views_of_split(read_cameras(cameras), name, cameras)


def views_of_split(cameras: Sequence[Camera], name: str, source: str | Path) -> list[Camera]:
    """Return the cameras in a split, in the order of their names; raise `InputError` for the source if it is empty."""
    train, test = split(cameras)
    views = {"train": train, "test": test, "all": sorted(cameras, key=lambda camera: camera.name)}[name]
    if not views:
        raise InputError(source, "cameras", expected=f"at least one {name} view", found="none")
    return views
