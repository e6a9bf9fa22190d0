"""The photographs that views were taken from: how large they are, and whether all are there."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.images import opened


def photograph_size(path: Path) -> tuple[int, int]:
    """Return (width, height) of an image file, from its header.

    Raises
    ------
    InputError
        The file is missing or no image, or has too many pixels.

    """
    with opened(path) as image:
        return image.size


def require_images(cameras: Sequence[Camera], source: Path | str) -> None:
    """Make sure that every view has a photograph, at least as large as the view; `source` is where the views are from.

    Raises
    ------
    InputError
        The first view whose photograph is unknown, missing, unreadable, or smaller than the view.

    """
    for camera in cameras:
        field = f"{camera.name}.image"
        if camera.image is None:
            raise InputError(source, field, expected="a photograph", found="none named")
        if not camera.image.is_file():
            raise InputError(source, field, expected="an existing photograph", found=str(camera.image))
        width, height = photograph_size(camera.image)
        if width < camera.width or height < camera.height:
            expected = f"a photograph of at least {camera.width}x{camera.height}"
            raise InputError(source, field, expected=expected, found=f"{width}x{height}", hint="choose a smaller scale")
