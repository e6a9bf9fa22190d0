"""Removal of lens distortion from photographs, since the renderer's cameras are pinholes.

Source: https://docs.opencv.org/4.x/d9/d0c/group__calib3d.html, the model of Brown and Conrady, which COLMAP and
nerfstudio share.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float32, Float64
from gspure.cameras.camera import LENS_COEFFICIENTS, Camera
from gspure.cameras.photographs import photograph, require_images
from gspure.errors import InputError
from gspure.images import read_image, write_image
from gspure.progress import track

_MOST_ZOOM: Final = 8.0
_STEPS: Final = 40  # of the bisection for the zoom
_RADII: Final = 1000  # number of radii at which the distortion is evaluated


def undistort(cameras: Sequence[Camera], folder: Path, source: Path | str) -> list[Camera]:
    """Write the undistorted photograph of each view as ``VIEW.png`` to `folder`, and return the pinhole cameras.

    Image size and centre stay; the focal length is the smallest at which the photograph fills the image. Transparent
    photographs keep their alpha. `source` is the origin of the views. Raise `InputError` for a distortion that folds
    the image: points farther from the image's centre would not be farther from the photograph's.
    """
    require_images(cameras, source)
    pinholes = [_pinhole(camera, source) for camera in cameras]
    targets = [replace(pinhole, image=folder / f"{pinhole.name}.png") for pinhole in pinholes]
    for camera, target in track(list(zip(cameras, targets, strict=True)), "undistort"):
        write_image(photograph(target), _resampled(camera, target))
    return targets


def _pinhole(camera: Camera, source: Path | str) -> Camera:
    """Return the same view without distortion."""
    rows, columns = np.indices((camera.height, camera.width))
    at_border = (rows % (camera.height - 1 or 1) == 0) | (columns % (camera.width - 1 or 1) == 0)
    border = np.stack([columns[at_border], rows[at_border]], 1) + 0.5

    def zoomed(factor: float) -> Camera:
        scale = np.diag([factor, factor, 1.0])
        scale[:2, 2] = (1 - factor) * camera.K[:2, 2]
        return replace(camera, K=scale @ camera.K, distortion=())

    low = 1 / _MOST_ZOOM
    high = _MOST_ZOOM
    for _ in range(_STEPS):
        middle = (low + high) / 2
        if _is_filled(camera, zoomed(middle), border):
            high = middle
        else:
            low = middle
    if not _is_filled(camera, zoomed(high), border) or _folds(camera, zoomed(low), border):
        expected = "a lens that a pinhole can replace"
        coefficients = " ".join(f"{coefficient:g}" for coefficient in camera.distortion)
        raise InputError(source, f"{camera.name}.distortion", expected=expected, found=coefficients)
    return zoomed(high)


def _is_filled(camera: Camera, pinhole: Camera, border: Float64) -> bool:
    """Return whether the photograph fills the image of `pinhole`: its border [N,2] lies within the photograph."""
    points = _distorted(camera, pinhole, border)
    is_inside = (points >= 0.5) & (points <= np.array([camera.width, camera.height]) - 0.5)
    return bool(is_inside.all()) and not _folds(camera, pinhole, border)


def _folds(camera: Camera, pinhole: Camera, border: Float64) -> bool:
    """Return whether the distorted radius falls anywhere in the image of `pinhole` as the radius grows."""
    radii = np.linspace(0, np.linalg.norm(_directions(pinhole, border), axis=0).max(), _RADII)
    return bool((np.diff(radii * _radial(camera, radii**2)) < 0).any())


def _directions(pinhole: Camera, points: Float64) -> Float64:
    """Return x/z and y/z [2,N] of the rays through pixels."""
    return np.asarray((points - pinhole.K[:2, 2]) / pinhole.K[[0, 1], [0, 1]]).T


def _radial(camera: Camera, r2: Float64) -> Float64:
    """Return the factors by which the lens moves points away from the centre, at squared distances [N]."""
    k1, k2, _, _, k3, k4, k5, k6 = _all_coefficients(camera)
    return (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))


def _all_coefficients(camera: Camera) -> tuple[float, ...]:
    """Return the `LENS_COEFFICIENTS` of a camera, zero where it names none."""
    missing = len(LENS_COEFFICIENTS) - len(camera.distortion)
    return (*camera.distortion, *repeat(0.0, missing))


def _distorted(camera: Camera, pinhole: Camera, points: Float64) -> Float64:
    """Return the pixels [N,2] in the photograph of `camera` that show points [N,2] of the image of `pinhole`."""
    x, y = _directions(pinhole, points)
    _, _, p1, p2, *_ = _all_coefficients(camera)
    r2 = x * x + y * y
    tangential_x = 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    tangential_y = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    tangential = np.stack([tangential_x, tangential_y], 1)
    distorted = np.stack([x, y], 1) * _radial(camera, r2)[:, None] + tangential
    return np.asarray(distorted * camera.K[[0, 1], [0, 1]] + camera.K[:2, 2])


def _resampled(camera: Camera, pinhole: Camera) -> Float32:
    """Return the photograph of `camera` as `pinhole` takes it, by cubic interpolation of premultiplied colours."""
    from scipy.ndimage import map_coordinates

    image = read_image(photograph(camera), (camera.width, camera.height), background=None)
    has_alpha = image.shape[2] == 4
    if has_alpha:
        image[..., :3] *= image[..., 3:]
    rows, columns = np.indices(image.shape[:2])
    pixels = np.stack([columns.ravel(), rows.ravel()], 1).astype(np.float64)
    points = _distorted(camera, pinhole, pixels + 0.5) - 0.5
    places = points[:, ::-1].T.reshape(2, *image.shape[:2])
    channels = np.moveaxis(image, 2, 0)
    resampled = np.stack([map_coordinates(channel, places, order=3, mode="nearest") for channel in channels], 2)
    if has_alpha:
        resampled[..., :3] /= np.maximum(resampled[..., 3:], 1 / 255)
    return resampled
