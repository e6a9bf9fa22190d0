"""Viewpoints of point clouds."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64, Indices
from gspure.cameras.camera import Camera, intrinsics, rigid
from gspure.cameras.orbit import guessed_up

_BULK = (0.02, 0.98)  # quantiles that bound the points without floaters
_NEAREST = 0.1  # least distance of an overview from the framed points, times their extent
_MARGIN = 1.04  # of an overview, times the extent of the framed points
_TALLEST = 0.8  # greatest height over width of an overview
_FLATTEST = 0.45  # least height over width of an overview
_FIELD_OF_VIEW = np.radians(35.0)
_ELEVATION = np.radians(25.0)
_AZIMUTH = np.radians(30.0)
_CELLS = 100  # across the picture, in the grid of foremost points
_MOST = 100_000  # points that decide a viewpoint
_AGREEMENT = 0.25  # directions agree if the length of their mean is more than this share of their mean length


def world_axes(means: NDArray[np.floating], cameras: Sequence[Camera]) -> Float64:
    """Return the directions right, up and front of the model's world, as the rows of a rotation [3,3].

    Up is the mean up direction of the cameras; if they do not agree, it is guessed. The front is the side with most
    cameras; without a preferred side or cameras, it is -z, or -y if z is up.
    """
    means = _sample(means)
    points = np.asarray(_without_floaters(means), np.float64)
    flat_side = guessed_up(points, np.ones(len(points))).direction
    up = _agreed(-np.array([camera.viewmat[1, :3] for camera in cameras]).reshape(-1, 3), flat_side)
    offsets = np.array([camera.centre for camera in cameras]).reshape(-1, 3) - np.median(means, axis=0)
    level = offsets - np.outer(offsets @ up, up)
    front = _agreed(level, np.cross(np.eye(3)[np.argmin(np.abs(up))], up))
    return np.stack([np.cross(up, front), up, front])


def _agreed(vectors: Float64, otherwise: Float64) -> Float64:
    """Return the unit vector along the mean of `vectors` [N,3], or along `otherwise` if they do not agree."""
    total = vectors.sum(axis=0)
    if np.linalg.norm(total) <= _AGREEMENT * np.linalg.norm(vectors, axis=1).sum():
        total = otherwise
    return np.asarray(total / np.linalg.norm(total))


def choose_camera(means: NDArray[np.floating], cameras: Sequence[Camera]) -> Camera:
    """Return a view of the whole cloud: from outside if the cameras surround it, else one of them.

    If most cameras are inside the cloud (a room, an open landscape), return the one that sees the most points; of
    equals, the first by name.
    """
    centres = np.array([camera.centre for camera in cameras]).reshape(-1, 3)
    low, high = np.quantile(means, _BULK, axis=0)
    within = ((centres > low) & (centres < high)).all(axis=1)
    if within.sum() * 2 <= len(cameras):
        return overview(means, world_axes(means, cameras))
    return max(sorted(cameras, key=lambda camera: camera.name), key=lambda camera: len(in_view(means, camera)))


def overview(means: NDArray[np.floating], axes: Float64) -> Camera:
    """Return a camera outside the cloud that frames it without floaters, from above and one side of its axes."""
    right, up, front = axes
    side = np.cos(_AZIMUTH) * front + np.sin(_AZIMUTH) * right
    towards_eye = np.cos(_ELEVATION) * side + np.sin(_ELEVATION) * up
    x = np.cross(up, towards_eye)
    x /= np.linalg.norm(x)
    R = np.stack([x, -np.cross(towards_eye, x), -towards_eye])  # rows: image right, image down, forward
    local = _without_floaters(_sample(means)) @ R.T

    # A point is inside the image where |x - x0| <= t (z - z0), and likewise in y; t is the half extent at z - z0 = 1.
    t = np.tan(_FIELD_OF_VIEW / 2)
    low = (-local[:, :2] - t * local[:, 2:]).max(axis=0)
    high = (local[:, :2] - t * local[:, 2:]).max(axis=0)
    nearest = local[:, 2].min() - _NEAREST * (float(np.ptp(local, axis=0).max()) or 1.0)
    eye = np.append((high - low) / 2, min(-((high + low) / (2 * t)).max(), nearest))

    # The image is 1000 pixels wide and filled by the slopes x / z and y / z.
    slopes = (local[:, :2] - eye[:2]) / (local[:, 2:] - eye[2])
    low = slopes.min(axis=0)
    high = slopes.max(axis=0)
    width, height = np.maximum((high - low) * _MARGIN, 1e-3)
    width = max(width, height / _TALLEST)
    focal = 1000 / width
    rows = round(focal * max(height, width * _FLATTEST))
    cx, cy = np.array([500, rows / 2]) - focal * (low + high) / 2
    return Camera("overview", 1000, rows, intrinsics(focal, focal, cx, cy), rigid(R, -eye))


def _sample(means: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return as many points as a viewpoint depends on, evenly spread over the rows."""
    return means[:: len(means) // _MOST + 1]


def _without_floaters(means: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the points in the box around the bulk, widened on every side by half its extent."""
    low, high = np.quantile(means, _BULK, axis=0)
    slack = (high - low) / 2
    inside: NDArray[np.floating] = means[((means >= low - slack) & (means <= high + slack)).all(axis=1)]
    return inside


def project(means: NDArray[np.floating], camera: Camera) -> tuple[Float64, Float64]:
    """Return pixel coordinates [K,2] and depths [K] of points; pixels are NaN at or behind the camera's plane."""
    local = means @ camera.viewmat[:3, :3].T + camera.viewmat[:3, 3]
    depth = local[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = np.where(depth[:, None] > 0, (local @ camera.K.T)[:, :2] / depth[:, None], np.nan)
    return pixels, depth


def in_view(means: NDArray[np.floating], camera: Camera) -> Indices:
    """Return the rows that a picture from `camera` shows, without floaters far in front of or behind all others.

    Floaters would extend the depth range, and with it the shading, over empty space.
    """
    pixels, depth = project(means, camera)
    with np.errstate(invalid="ignore"):
        inside = (depth > 0) & ((pixels >= 0) & (pixels < (camera.width, camera.height))).all(axis=1)
    if inside.any():
        nearest, farthest = np.quantile(depth[inside], _BULK)
        inside &= (depth >= nearest / 2) & (depth <= farthest * 2)
    return np.flatnonzero(inside)


def fitted(camera: Camera, width: int) -> Camera:
    """Return the same view in an image of this width, with square pixels."""
    height = round(width * (camera.height / camera.K[1, 1]) / (camera.width / camera.K[0, 0]))
    return camera.resized(width, max(height, 1))


def framed(camera: Camera, width: int, height: int) -> Camera:
    """Return the same view, whole and with square pixels, in the middle of an image of this size."""
    inner = fitted(camera, width)
    if inner.height > height:
        inner = fitted(camera, round(width * height / inner.height))
    K = inner.K.copy()
    K[:2, 2] += (width - inner.width) / 2, (height - inner.height) / 2
    return replace(inner, width=width, height=height, K=K)


def foremost(means: NDArray[np.floating], camera: Camera) -> tuple[Indices, Float64]:
    """Return the rows of points that no other hides, and their pixels [N,2]: the nearest in each cell of a grid."""
    rows = in_view(means, camera)
    pixels, depth = project(means[rows], camera)
    order = np.argsort(depth, kind="stable")
    column, row = (pixels[order] / (camera.width / _CELLS)).astype(int).T
    nearest = order[np.unique(column * camera.height + row, return_index=True)[1]]
    return rows[nearest], pixels[nearest]
