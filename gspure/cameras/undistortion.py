"""Photographs without the distortion of their lens, as the renderer's pinhole cameras see them.

Source: https://docs.opencv.org/4.x/d9/d0c/group__calib3d.html, the model of Brown and Conrady, which COLMAP and
nerfstudio share.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float32, Float64
from gspure.cameras.camera import COEFFICIENTS, Camera
from gspure.cameras.photographs import photograph, require_images
from gspure.errors import InputError
from gspure.images import read_image, write_image
from gspure.progress import track

_ZEROS: Final = (0.0,) * len(COEFFICIENTS)  # of a pinhole
_MOST_ZOOM: Final = 8.0
_STEPS: Final = 40  # of the search for the zoom, each of which halves its range
_RADII: Final = 1000  # number of radii at which the distortion is compared


def undistort(cameras: Sequence[Camera], folder: Path, source: Path | str) -> list[Camera]:
    """Write the photograph of each view as a pinhole camera takes it, and return these cameras.

    The focal length is the smallest at which the photograph fills the image, whose size and centre stay. Transparent
    photographs keep their alpha. `folder` takes ``VIEW.png``; `source` is the origin of the views. A distortion that
    folds the image, so that points farther from its centre are not farther from the photograph's, is refused.
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

    low, high = 1 / _MOST_ZOOM, _MOST_ZOOM
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (low, middle) if _is_filled(camera, zoomed(middle), border) else (middle, high)
    if not _is_filled(camera, zoomed(high), border) or _folds(camera, zoomed(low), border):
        found = " ".join(f"{coefficient:g}" for coefficient in camera.distortion)
        raise InputError(source, f"{camera.name}.distortion", expected="a lens that a pinhole can replace", found=found)
    return zoomed(high)


def _is_filled(camera: Camera, pinhole: Camera, border: Float64) -> bool:
    """Return whether the lens shows the border [N,2] of `pinhole` between the centres of its outer pixels."""
    points = _distorted(camera, pinhole, border)
    is_inside = (points >= 0.5) & (points <= np.array([camera.width, camera.height]) - 0.5)
    return bool(is_inside.all()) and not _folds(camera, pinhole, border)


def _folds(camera: Camera, pinhole: Camera, border: Float64) -> bool:
    """Return whether the lens shows a farther point of `pinhole` nearer to the centre."""
    radii = np.linspace(0, np.linalg.norm(_directions(pinhole, border), axis=0).max(), _RADII)
    return bool((np.diff(radii * _radial(camera, radii**2)) < 0).any())


def _directions(pinhole: Camera, points: Float64) -> Float64:
    """Return x/z and y/z [2,N] of the rays through pixels."""
    return np.asarray((points - pinhole.K[:2, 2]) / pinhole.K[[0, 1], [0, 1]]).T


def _radial(camera: Camera, r2: Float64) -> Float64:
    """Return the factors by which the lens moves points away from the centre, at squared distances [N]."""
    k1, k2, _, _, k3, k4, k5, k6 = *camera.distortion, *_ZEROS[len(camera.distortion) :]
    return (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))


def _distorted(camera: Camera, pinhole: Camera, points: Float64) -> Float64:
    """Return where the lens of `camera` shows what `pinhole` has at these points [N,2], in pixels."""
    x, y = _directions(pinhole, points)
    _, _, p1, p2, *_ = *camera.distortion, *_ZEROS[len(camera.distortion) :]
    r2 = x * x + y * y
    tangential = np.stack([2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], 1)
    lens = np.stack([x, y], 1) * _radial(camera, r2)[:, None] + tangential
    return np.asarray(lens * camera.K[[0, 1], [0, 1]] + camera.K[:2, 2])


def _resampled(camera: Camera, pinhole: Camera) -> Float32:
    """Return the photograph of `camera` as `pinhole` takes it, by cubic interpolation."""
    from scipy.ndimage import map_coordinates

    image = read_image(photograph(camera), (camera.width, camera.height), background=None)
    image[..., :3] *= image[..., 3:] if image.shape[2] == 4 else 1
    rows, columns = np.indices(image.shape[:2])
    pixels = np.stack([columns.ravel(), rows.ravel()], 1).astype(np.float64)
    points = _distorted(camera, pinhole, pixels + 0.5) - 0.5
    places = points[:, ::-1].T.reshape(2, *image.shape[:2])
    taken = np.stack([map_coordinates(c, places, order=3, mode="nearest") for c in np.moveaxis(image, 2, 0)], 2)
    taken[..., :3] /= np.maximum(taken[..., 3:], 1 / 255) if image.shape[2] == 4 else 1
    return taken
