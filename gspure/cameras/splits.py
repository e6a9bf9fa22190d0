"""Splits of the views: training and held-out ones."""

from collections.abc import Sequence
from pathlib import Path

from gspure.cameras.camera import Camera
from gspure.cameras.reading import read_cameras
from gspure.constants import TEST_EVERY
from gspure.errors import InputError


def split(cameras: Sequence[Camera]) -> tuple[list[Camera], list[Camera]]:
    """Return (train, test): sorted by name, every eighth camera from the first on is a test view (3DGS --eval)."""
    ordered = sorted(cameras, key=lambda camera: camera.name)
    return [camera for i, camera in enumerate(ordered) if i % TEST_EVERY], ordered[::TEST_EVERY]


def read_split(cameras: Path, name: str) -> list[Camera]:
    """Return the views of a split, ``train``, ``test`` or ``all``, in the order of their names."""
    return views_of_split(read_cameras(cameras), name, cameras)


def views_of_split(cameras: Sequence[Camera], name: str, source: str | Path) -> list[Camera]:
    """Return those of the cameras of a source that are in a split, in the order of their names."""
    train, test = split(cameras)
    views = {"train": train, "test": test, "all": sorted(cameras, key=lambda camera: camera.name)}[name]
    if not views:
        raise InputError(source, "cameras", expected=f"at least one {name} view", found="none")
    return views
