"""Views beside the camera path, which neither training nor contributions use."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from gspure.cameras.camera import Camera, looking_at, split
from gspure.errors import InputError
from gspure.files import Float64

PREFIX: Final = "off_path_"  # prefix of the names of such views

STEP: Final = 0.25
"""Their distance from the path, in root-mean-square distances of its cameras from their mean. Ours: clearly off an
orbit, and still inside a captured room."""

_STEPS: Final = np.array([(-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (1.0, 1.0)]) / np.sqrt(2)
"""Steps down and forward, one per view in turn."""


def off_path_cameras(cameras: Sequence[Camera], count: int) -> list[Camera]:
    """Return views above or below training views, nearer or farther, that look at the same point.

    `count` of them are spread evenly over the path of all `cameras`. Raise `InputError` if views are already named
    `PREFIX`, or all training views have the same position.
    """
    train, _ = split(cameras)
    spread = _spread(train)
    named = [camera.name for camera in cameras if camera.name.startswith(PREFIX)]
    if named or not spread > 0:
        expected = f"two or more training views in different places, none named {PREFIX}*"
        found, hint = (
            named[0] if named else f"{len(train)} in one place",
            "off_path: 0 in a configuration omits them",
        )
        raise InputError("cameras", "off-path views", expected=expected, found=found, hint=hint)
    target = _target(train)
    starts = [train[i * len(train) // count] for i in range(count)]
    return [_aside(start, f"{PREFIX}{i:03d}", STEP * spread * _STEPS[i % 4], target) for i, start in enumerate(starts)]


def _spread(cameras: Sequence[Camera]) -> float:
    centres = np.array([camera.centre for camera in cameras]).reshape(-1, 3)
    return float(np.sqrt(np.mean(np.sum((centres - centres.mean(axis=0)) ** 2, axis=1)))) if len(centres) else 0.0


def _target(cameras: Sequence[Camera]) -> Float64:
    """Return the point [3] nearest to all optical axes: sum_i (I - f_i f_i^T) (x - c_i) = 0."""
    centres = np.array([camera.centre for camera in cameras])
    forward = np.array([camera.viewmat[2, :3] for camera in cameras])
    across = np.eye(3) - forward[:, :, None] * forward[:, None, :]
    right = (across @ centres[:, :, None]).sum(axis=0)[:, 0]
    target: Float64 = np.linalg.lstsq(across.sum(axis=0), right, rcond=None)[0]
    return target


def _aside(camera: Camera, name: str, step: Float64, target: Float64) -> Camera:
    """Return a view moved by `step` (down, forward) that looks at the point on its axis at the target's distance."""
    forward, down, centre = camera.viewmat[2, :3], camera.viewmat[1, :3], camera.centre
    distance = max(float(forward @ (target - centre)), 2 * float(np.linalg.norm(step)))  # the target may be behind
    focus = centre + distance * forward
    moved = centre + step[0] * down + step[1] * forward
    return replace(camera, name=name, viewmat=looking_at(moved, focus, -down), image=None)
