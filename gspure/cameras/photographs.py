"""The photographs of views: their sizes, and missing ones."""

from collections.abc import Sequence
from pathlib import Path

from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.images import opened


def photograph_size(path: Path) -> tuple[int, int]:
    """Return (width, height) of an image file, from its header.

    Raise `InputError` if the file is missing or no image, or has too many pixels.
    """
    with opened(path) as image:
        return image.size


def is_present(image: Path) -> bool:
    """Return whether an image exists; False if its name is too long for the file system."""
    try:
        return image.is_file()
    except OSError:
        return False


def photograph(camera: Camera) -> Path:
    """Return the file of a view's photograph, or raise `InputError` if the view names none."""
    if camera.image is None:
        raise InputError(camera.name, "image", expected="a photograph", found="none named")
    return camera.image


def missing_photographs(cameras: Sequence[Camera]) -> list[str]:
    """Return the photographs that do not exist, in the order of views; for a view without photograph, its name."""
    images = [(camera.name, camera.image) for camera in cameras]
    return [str(image or f"view {name}") for name, image in images if image is None or not is_present(image)]


def require_present(cameras: Sequence[Camera], source: Path | str, hint: str | None = None) -> None:
    """Require a photograph of every view of `source`, or raise `InputError` with all missing ones."""
    if missing := missing_photographs(cameras):
        found = f"{len(missing)} missing: {', '.join(missing)}"
        raise InputError(source, "photographs", expected=f"one of each of {len(cameras)} views", found=found, hint=hint)


def require_images(cameras: Sequence[Camera], source: Path | str) -> None:
    """Require a photograph of every view of `source`, at least as large as the view.

    Raise `InputError` with all missing photographs, or the first one that is unreadable or smaller than its view.
    """
    require_present(cameras, source)
    for camera in cameras:
        width, height = photograph_size(photograph(camera))
        if width < camera.width or height < camera.height:
            field = f"{camera.name}.image"
            expected = f"a photograph of at least {camera.width}x{camera.height}"
            raise InputError(source, field, expected=expected, found=f"{width}x{height}", hint="choose a smaller scale")
