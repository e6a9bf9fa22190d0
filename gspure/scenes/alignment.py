"""Alignment of two captures by their cameras.

Every capture has its own coordinate system: origin, axes and unit are arbitrary. Without alignment, most views of one
capture show nothing of the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gspure.arrays import Float64
from gspure.cameras.camera import Camera, rigid
from gspure.errors import InputError


@dataclass(frozen=True, eq=False)
class Similarity:
    """x -> scale rotation x + translation, from coordinates of the scene to those of the message."""

    scale: float
    rotation: Float64
    translation: Float64

    def camera(self, camera: Camera) -> Camera:
        """Return the camera in coordinates of the message that shows what `camera` shows of the scene."""
        rotation = camera.viewmat[:3, :3] @ self.rotation.T
        translation = self.scale * camera.viewmat[:3, 3] - rotation @ self.translation
        return replace(camera, viewmat=rigid(rotation, translation))

    def points(self, points: Float64) -> Float64:
        """Return points [P,3] of the scene in coordinates of the message."""
        return np.asarray(self.scale * points @ self.rotation.T + self.translation)

    @property
    def inverse(self) -> Similarity:
        """The similarity from coordinates of the message to those of the scene."""
        scale = 1 / self.scale
        rotation = self.rotation.T
        return Similarity(scale, rotation, -scale * rotation @ self.translation)


def aligning(scene: Sequence[Camera], message: Sequence[Camera]) -> Similarity:
    """Return the similarity that aligns the cameras of the scene with those of the message.

    It aligns the gaze point, the mean up direction, the mean direction from the gaze point to the cameras, and their
    median distance from it.
    """
    scene_point, scene_axes, scene_distance = _gaze(scene, "scene")
    message_point, message_axes, message_distance = _gaze(message, "message")
    scale = message_distance / scene_distance
    rotation = message_axes @ scene_axes.T
    return Similarity(scale, rotation, message_point - scale * rotation @ scene_point)


def _gaze(cameras: Sequence[Camera], capture: str) -> tuple[Float64, Float64, float]:
    """Return the gaze point, axes [3,3] in columns (side, up, towards the cameras), and the median distance."""
    centres = np.array([camera.centre for camera in cameras])
    gazes = np.array([camera.viewmat[2, :3] for camera in cameras])
    across = np.eye(3) - gazes[:, :, None] * gazes[:, None, :]
    # The point nearest to all optical axes: sum of (I - d d^T)(x - c) = 0.
    normal = across.sum(axis=0)
    if np.linalg.cond(normal) > 1e6:
        raise InputError(capture, "views", expected="different directions", found="parallel gazes")
    point = np.linalg.solve(normal, np.einsum("vij,vj->i", across, centres))
    distance = float(np.median(np.linalg.norm(centres - point, axis=1)))
    up = -np.mean([camera.viewmat[1, :3] for camera in cameras], axis=0)
    up /= np.linalg.norm(up)
    towards = centres.mean(axis=0) - point
    towards -= up * (up @ towards)
    if not (distance > 0 and np.linalg.norm(towards) > 1e-3 * distance):
        towards = up * (up @ gazes[0]) - gazes[0]  # cameras all around: the direction of the first
    towards /= np.linalg.norm(towards)
    return point, np.column_stack([np.cross(up, towards), up, towards]), distance
