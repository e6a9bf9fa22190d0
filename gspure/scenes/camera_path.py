"""Cameras that photograph a stage: a closed, smooth path in front of it and above its floor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera, intrinsics, looking_at

Float64 = NDArray[np.float64]

TARGET = (0.0, 0.5, 0.75)
"""Where all cameras look, metres."""

UP = np.array([0.0, 0.0, 1.0])


def stage_cameras(count: int, width: int, height: int) -> list[Camera]:
    """Return `count` views, 62 degrees wide, along a path that sways to both sides, to and fro, up and down."""
    focal = 0.83 * width
    K = intrinsics(focal, focal, width / 2, height / 2)
    digits = max(3, len(str(count - 1)))
    return [
        Camera(f"view_{i:0{digits}d}", width, height, K, looking_at(_station(i / count), np.array(TARGET), UP))
        for i in range(count)
    ]


def _station(phase: float) -> Float64:
    """Return the camera centre [3] at a phase 0..1 of the path."""
    turn = 2.0 * np.pi * phase
    azimuth = np.radians(38.0) * np.sin(turn)
    radius = 3.7 + 0.5 * np.cos(3.0 * turn)
    height = 1.75 + 0.55 * np.sin(2.0 * turn + 0.6)
    return np.array([radius * np.sin(azimuth), TARGET[1] - radius * np.cos(azimuth), height])
