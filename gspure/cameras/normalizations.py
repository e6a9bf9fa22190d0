"""How trainers move a capture before they train on it, computed from its cameras and points.

gsplat turns the mean up direction to -y, centres the views' points of interest, divides by the median distance of the
cameras, and then turns the principal axes of the points to x, y and z. nerfstudio turns up to +z, centres the cameras,
and divides by their largest coordinate; of a COLMAP model, it first swaps the axes.

Source: the options ``normalize_world_space`` of https://docs.gsplat.studio, and ``orientation_method``,
``center_method`` and ``auto_scale_poses`` of https://docs.nerf.studio.
"""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from gspure.arrays import Float64
from gspure.cameras.camera import Camera, rigid
from gspure.model.rotations import rotation

_UP_IN_COLMAP: Final = np.array([0.0, -1.0, 0.0])
_UP: Final = np.array([0.0, 0.0, 1.0])
_SWAPPED: Final = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # x, z, -y
_HALF_TURNS: Final = [np.diag(signs) for signs in ((1.0, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))]


def normalizations(cameras: Sequence[Camera], xyz: Float64) -> Iterator[tuple[str, Float64]]:
    """Yield name and similarity [4,4] of each normalization of cameras and points [P,3], of which there may be none."""
    centres = np.array([camera.centre for camera in cameras])
    up = -np.mean([camera.viewmat[1, :3] for camera in cameras], axis=0)
    gazes = np.array([camera.viewmat[2, :3] for camera in cameras])
    if not np.linalg.norm(up) > 0:
        return
    yield from _of_nerfstudio(centres, up)
    turn = _turn(up, _UP_IN_COLMAP)
    seen = centres @ turn.T
    gazes = gazes @ turn.T
    nearest = seen - (gazes * seen).sum(axis=1, keepdims=True) * gazes
    focus = np.median(nearest, axis=0)
    distance = np.median(np.linalg.norm(seen - focus, axis=1))
    if not distance > 0:
        return
    by_cameras = rigid(turn / distance, -focus / distance)
    yield "gsplat's normalization by cameras", by_cameras
    if len(xyz) > 3:
        for number, by_points in enumerate(_principal(xyz @ by_cameras[:3, :3].T + by_cameras[:3, 3]), start=1):
            yield f"gsplat's normalization (choice {number} of 4 of its axes' signs)", by_points @ by_cameras


def _of_nerfstudio(centres: Float64, up: Float64) -> Iterator[tuple[str, Float64]]:
    for name, axes in (("", np.eye(3)), (" of a COLMAP model", _SWAPPED)):
        turn = _turn(axes @ up, _UP) @ axes
        middle = turn @ centres.mean(axis=0)
        size = np.abs(centres @ turn.T - middle).max()
        if size > 0:
            yield f"nerfstudio's default normalization{name}", rigid(turn / size, -middle / size)


def _principal(xyz: Float64) -> Iterator[Float64]:
    """Yield the rigid transforms [4,4] to the principal axes of points, the longest first, of either sense."""
    centre = np.median(xyz, axis=0)
    _, axes = np.linalg.eigh(np.cov(xyz - centre, rowvar=False))
    turn = axes.T[::-1]
    turn[0] *= np.sign(np.linalg.det(turn))
    for half_turn in _HALF_TURNS:
        yield rigid(half_turn @ turn, -half_turn @ turn @ centre)


def _turn(direction: Float64, target: Float64) -> Float64:
    """Return the smallest rotation [3,3] of a direction to a unit vector."""
    direction = direction / np.linalg.norm(direction)
    axis = np.cross(direction, target)
    sine = np.linalg.norm(axis)
    angle = np.arctan2(sine, direction @ target)
    return rotation(axis / sine * angle if sine > 0 else np.array([angle, 0.0, 0.0]))
