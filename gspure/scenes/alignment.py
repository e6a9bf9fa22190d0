"""Two captures brought together: where the cameras of one scene would stand in the world of another.

Captures have worlds of their own: origin, axes and unit are arbitrary. A hidden scene that is to be seen from the poses
of another one must first be moved to where these look; else most views show nothing of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.errors import InputError

Float64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Similarity:
    """x -> scale rotation x + translation, from the scene's world to the message's."""

    scale: float
    rotation: Float64
    translation: Float64

    def camera(self, camera: Camera) -> Camera:
        """Return the camera of the message's world whose image is as `camera`'s of the moved scene."""
        viewmat = np.eye(4)
        viewmat[:3, :3] = camera.viewmat[:3, :3] @ self.rotation.T
        viewmat[:3, 3] = self.scale * camera.viewmat[:3, 3] - viewmat[:3, :3] @ self.translation
        return replace(camera, viewmat=viewmat)

    def points(self, points: Float64) -> Float64:
        """Return points [P,3] of the scene's world in the message's."""
        return np.asarray(self.scale * points @ self.rotation.T + self.translation)

    @property
    def inverse(self) -> Similarity:
        """The similarity from the message's world to the scene's."""
        scale, rotation = 1 / self.scale, self.rotation.T
        return Similarity(scale, rotation, -scale * rotation @ self.translation)


def aligning(scene: Sequence[Camera], message: Sequence[Camera]) -> Similarity:
    """Return the similarity that lays what the scene's cameras look at onto what the message's look at.

    Gaze point, mean upward direction, mean direction from the gaze point to the cameras, and their median distance
    from it come to agree.

    Raise `InputError` if the cameras of one capture do not look at anything in common.
    """
    here, there = _Gaze.of(scene, "scene"), _Gaze.of(message, "message")
    scale = there.distance / here.distance
    rotation = there.axes @ here.axes.T
    return Similarity(scale, rotation, there.point - scale * rotation @ here.point)


@dataclass(frozen=True, eq=False)
class _Gaze:
    """What a set of cameras looks at: a point, axes [3,3] in columns (side, up, towards the cameras), and how far."""

    point: Float64
    axes: Float64
    distance: float

    @staticmethod
    def of(cameras: Sequence[Camera], capture: str) -> _Gaze:
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
        towards = centres.mean(axis=0) - point
        up /= np.linalg.norm(up)
        towards -= up * (up @ towards)
        if not (distance > 0 and np.linalg.norm(towards) > 1e-3 * distance):
            towards = up * (up @ gazes[0]) - gazes[0]  # cameras all around: that of the first one will do
        towards /= np.linalg.norm(towards)
        return _Gaze(point, np.column_stack([np.cross(up, towards), up, towards]), distance)
