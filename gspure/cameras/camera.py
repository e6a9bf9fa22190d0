"""A pinhole camera, in COLMAP's axes and pixel convention."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64, Indices
from gspure.constants import LARGEST, NEAR_PLANE
from gspure.errors import InputError
from gspure.settings import SIDE
from gspure.text import Described

LENS_COEFFICIENTS: Final = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # distortion, in OpenCV's order

_RIGID: Final = 1e-3  # tolerance: admits rotations printed with four digits, not scale, shear or mirroring

# Ours:
_LEAST_FACTOR: Final = 1.8  # at which intrinsics are those of a larger image: images are halved, if not more
_ALIKE: Final = 0.1  # largest difference of the factors of cx and cy, relative
_FARTHEST: Final = 3.0  # distance of the principal point from the centre, in half sides; crops stay below it
_NARROWEST: Final = 2 * math.tan(math.radians(3) / 2)  # least field of view, 3 degrees, as image side per focal length


@dataclass(frozen=True, eq=False, repr=False)
class Camera(Described):
    """One view: its pose, intrinsics and image size.

    Axes are COLMAP's (x right, y down, z forward). The centre of the pixel in column i and row j lies at (i + 0.5,
    j + 0.5), so a principal point in the middle of the image is (width / 2, height / 2).

    Parameters
    ----------
    name : str
        Unique name of the view, without a file suffix; outputs are named after it.
    width, height : int
        Image size in pixels.
    K : array [3,3]
        Intrinsics in pixels of that size: fx, fy, cx, cy; no skew.
    viewmat : array [4,4]
        World to camera, rigid.
    image : Path, optional
        The photograph of this view, if any.
    distortion : tuple of float
        The `LENS_COEFFICIENTS`, or the first few of them; empty for a pinhole. Only `gspure.cameras.undistortion` uses
        them.

    Raises
    ------
    InputError
        A size is no whole number of pixels, a number is not finite or above `LARGEST`, a focal length is not positive,
        `K` has skew or belongs to an image of another size, or `viewmat` has scale, shear or mirroring.

    """

    name: str
    width: int
    height: int
    K: Float64
    viewmat: Float64
    image: Path | None = None
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check all numbers, whatever their source."""
        for name, side in (("width", self.width), ("height", self.height)):
            SIDE.require(self.name, name, side)
            object.__setattr__(self, name, int(side))  # the device takes no integers of numpy
        magnitude = np.abs(self.numbers).max()
        if not magnitude <= LARGEST:
            raise InputError(self.name, "camera", expected=f"numbers within ±{LARGEST:g}", found=f"{magnitude:g}")
        fx, fy, cx, cy = self.numbers[2:6]
        if min(fx, fy) <= 0 or not np.array_equal(self.K, intrinsics(fx, fy, cx, cy)):
            elements = " ".join(map(str, np.ravel(self.K)))
            raise InputError(self.name, "K", expected="fx 0 cx 0 fy cy 0 0 1 with fx, fy > 0", found=elements)
        require_rigid(self.name, "viewmat", self.viewmat)
        self._require_own_size()

    def _require_own_size(self) -> None:
        """Refuse intrinsics in pixels of another size: nothing else shows that the image is wrong."""
        fx, fy, cx, cy = self.numbers[2:6]
        size = np.array([self.width, self.height])
        factors = 2 * np.array([cx, cy]) / size
        factor = float(np.sqrt(abs(factors.prod())))
        if np.ptp(factors) < _ALIKE * factor and not 1 / _LEAST_FACTOR < factor < _LEAST_FACTOR:
            found = f"those of an image {factor:.3g} times as wide (cx {cx:g}, cy {cy:g})"
        elif (np.abs(factors - 1) > _FARTHEST).any():
            found = f"a principal point far outside (cx {cx:g}, cy {cy:g})"
        elif max(self.width / fx, self.height / fy) < _NARROWEST:
            found = f"a field of view of {math.degrees(2 * math.atan(self.width / fx / 2)):.2g}° (fx {fx:g})"
        else:
            return
        hint = "scale fx, fy, cx and cy with the image"
        expected = f"intrinsics of an image of {self.width}x{self.height}"
        raise InputError(self.name, "K", expected=expected, found=found, hint=hint)

    @property
    def facts(self) -> dict[str, str]:
        """Name, size, focal length and centre."""
        return {
            "name": self.name,
            "size": f"{self.width}x{self.height}",
            "focal length": f"{self.K[0, 0]:.4g} px",
            "centre": " ".join(f"{x:.3g}" for x in self.centre),
        }

    @property
    def centre(self) -> Float64:
        """Camera centre [3] in world coordinates."""
        return -self.viewmat[:3, :3].T @ self.viewmat[:3, 3]

    @property
    def numbers(self) -> Float64:
        """All numbers that a rendering depends on [20]: size, fx, fy, cx, cy, and viewmat[:3] by rows."""
        intrinsics = [self.K[0, 0], self.K[1, 1], self.K[0, 2], self.K[1, 2]]
        return np.array([self.width, self.height, *intrinsics, *self.viewmat[:3].ravel()], np.float64)

    def resized(self, width: int, height: int) -> Camera:
        """Return the same view at another image size; the intrinsics are scaled by the two exact size ratios."""
        scale = np.diag([width / self.width, height / self.height, 1.0])
        return replace(self, width=width, height=height, K=scale @ self.K)

    def moved(self, transform: Float64) -> Camera:
        """Return the view moved by the similarity `transform` [4,4]; in it, a model moved likewise looks the same."""
        viewmat = self.viewmat @ np.linalg.inv(transform)
        volume = np.linalg.det(transform[:3, :3])
        if abs(volume - 1) > _RIGID:
            viewmat[:3] *= np.cbrt(volume)
        return replace(self, viewmat=viewmat)


def require_rigid(source: Path | str, field: str, transform: Float64) -> None:
    """Raise `InputError` for the `field` of a source unless a finite matrix [3,3] is a rotation, or [4,4] rigid."""
    rotation = transform[:3, :3]
    with np.errstate(all="ignore"):  # very large or very small numbers
        error = np.abs(rotation @ rotation.T - np.eye(3)).max()
        volume = np.linalg.det(rotation)
    if not (error <= _RIGID and volume > 0):
        defect = f"|R R^T - 1| = {error:.3g}, det R = {volume:.3g}"
        raise InputError(source, field, expected="a rotation without scale, shear or mirroring", found=defect)
    if transform[3:].ravel().tolist() not in ([], [0, 0, 0, 1]):
        raise InputError(source, field, expected="0 0 0 1 in the last row", found=" ".join(map(str, transform[3])))


def rigid(rotation: Float64, translation: Float64) -> Float64:
    """Return the transform [4,4] x -> rotation x + translation."""
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = translation
    return transform


def intrinsics(fx: float, fy: float, cx: float, cy: float) -> Float64:
    """Return the matrix [3,3] of a pinhole camera without skew."""
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def looking_at(centre: Float64, target: Float64, up: Float64) -> Float64:
    """Return the viewmat [4,4] of a camera at `centre` that looks at `target`; `up` is upright in its image."""
    forward = target - centre
    forward /= np.sqrt((forward * forward).sum())
    right = np.cross(forward, up)
    right /= np.sqrt((right * right).sum())
    rotation = np.stack([right, np.cross(forward, right), forward])
    return rigid(rotation, -(rotation * centre).sum(axis=1))


def spread(cameras: Sequence[Camera]) -> float:
    """Return the largest distance of a camera from their mean centre, in world units."""
    centres = np.array([camera.centre for camera in cameras])
    return float(np.linalg.norm(centres - centres.mean(axis=0), axis=1).max())


def points_shown(
    camera: Camera, points: NDArray[Any], margin: float = 0.0, near: float = NEAR_PLANE
) -> tuple[Indices, Float64]:
    """Return the rows [S] of the world `points` [P,3] in the image and deeper than `near`, and their positions [S,3].

    A position is column and row in pixels, and depth along the view axis. `margin` extends the image on every side, as
    a share of its size. A point that is not finite is not shown.
    """
    with np.errstate(all="ignore"):
        # Products of long arrays with three columns keep all threads of OpenBLAS busy; these do not.
        x, y, z = camera.viewmat[:3, :3] @ points.T + camera.viewmat[:3, 3, None]
        u = camera.K[0, 0] * x / z + camera.K[0, 2]
        v = camera.K[1, 1] * y / z + camera.K[1, 2]
        margin_x = margin * camera.width
        margin_y = margin * camera.height
        in_columns = (u >= -margin_x) & (u < camera.width + margin_x)
        in_rows = (v >= -margin_y) & (v < camera.height + margin_y)
        rows = np.flatnonzero(in_columns & in_rows & (z > near))
    return rows, np.stack([u, v, z], axis=1)[rows]
