"""Cameras and points for the tests of the camera formats."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from gspure.arrays import Float64
from gspure.cameras import Camera, intrinsics, read_cameras
from gspure.errors import InputError


def rotation_from(quat: ArrayLike) -> Float64:
    """Rotation of a quaternion (w, x, y, z) of any norm, by Rodrigues' formula."""
    unit = np.asarray(quat, float) / np.linalg.norm(quat)
    angle = 2 * np.arccos(np.clip(unit[0], -1, 1))
    sine = np.linalg.norm(unit[1:])
    if sine == 0:
        return np.eye(3)
    x, y, z = unit[1:] / sine
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation: Float64 = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return rotation


def project(camera: Camera, points: Float64) -> tuple[Float64, Float64]:
    """Pixel coordinates [P,2] and depths [P] of world points."""
    view = points @ camera.viewmat[:3, :3].T + camera.viewmat[:3, 3]
    return view[:, :2] / view[:, 2:] * np.diag(camera.K)[:2] + camera.K[:2, 2], view[:, 2]


def assert_refused(path: Path, field: str) -> None:
    """Check that cameras are refused by their file and this field, in one line."""
    with pytest.raises(InputError) as caught:
        read_cameras(path)
    assert (caught.value.source, caught.value.field) == (str(path), field)
    assert "\n" not in str(caught.value)


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


quats = st.tuples(*[numbers(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)


@st.composite
def cameras(draw: st.DrawFn, name: str = "view") -> Camera:
    width = draw(st.integers(1, 9000))
    height = draw(st.integers(1, 9000))
    viewmat = np.eye(4)
    viewmat[:3, :3] = rotation_from(draw(quats))
    viewmat[:3, 3] = draw(st.tuples(*[numbers(-1e3, 1e3)] * 3))
    centred = draw(st.booleans())
    centre = (0.5, 0.5) if centred else draw(st.tuples(numbers(0.3, 0.8), numbers(0.3, 0.8)))
    fx, fy = (draw(numbers(0.1, 5)) * side for side in (width, height))
    K = intrinsics(fx, fy, centre[0] * width, centre[1] * height)
    return Camera(name, width, height, K, viewmat)
