"""Where point clouds are looked at from."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gspure.cameras import Camera, intrinsics, orbit_cameras
from gspure.figures import viewpoint
from tests.models import points_of

RNG = np.random.default_rng(3)
BALL = RNG.normal(size=(400, 3)).astype(np.float32)


def looking_at(target: np.ndarray, eye: np.ndarray, down: tuple[float, ...] = (0, 1, 0), name: str = "view") -> Camera:
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(down, forward)
    right /= np.linalg.norm(right)
    viewmat = np.eye(4)
    viewmat[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    viewmat[:3, 3] = -viewmat[:3, :3] @ eye
    return Camera(name, 64, 48, intrinsics(50, 50, 32, 24), viewmat)


@settings(deadline=None)
@given(arrays(np.float64, 3, elements=st.floats(-50, 50)), st.floats(0.01, 100), st.integers(0, 1000))
def test_an_overview_holds_every_point_that_is_no_floater(centre: np.ndarray, size: float, seed: int) -> None:
    points = centre + size * np.random.default_rng(seed).uniform(-1, 1, (200, 3))
    camera = viewpoint.overview(points, viewpoint.world_axes(points, []))
    assert len(viewpoint.in_view(points, camera)) == 200
    pixels, _ = viewpoint.project(points, camera)
    filled = np.ptp(pixels, axis=0) / (camera.width, camera.height)
    assert filled.max() > 0.9


def test_up_is_up_in_an_overview_whatever_the_cameras_call_up() -> None:
    for down in ((0, 1, 0), (0, 0, -1)):
        around = [np.array([np.cos(a), np.sin(a)]) * 5 for a in np.arange(6)]
        level = [np.insert(xy, abs(np.array(down)).argmax(), 0.0) for xy in around]
        cameras = [looking_at(np.zeros(3), eye, down) for eye in level]
        axes = viewpoint.world_axes(BALL, cameras)
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1)
        assert axes[1] == pytest.approx(-np.array(down), abs=1e-9)
        camera = viewpoint.overview(BALL, axes)
        high, low = viewpoint.project(np.array([axes[1], -axes[1]]), camera)[0]
        assert high[1] < low[1]  # rows count downwards


def test_the_front_is_where_the_cameras_stand() -> None:
    eyes = [np.array([x, 0.0, 6.0]) for x in (-1, 0, 1)]
    cameras = [looking_at(np.zeros(3), eye) for eye in eyes]
    assert viewpoint.world_axes(BALL, cameras)[2] == pytest.approx([0, 0, 1], abs=0.05)
    assert viewpoint.world_axes(BALL, [])[2] == pytest.approx([0, 0, -1])
    ring = orbit_cameras(points_of(BALL, np.ones(400)), count=12, up=(0, 0, 1))
    assert viewpoint.world_axes(BALL, ring)[2] == pytest.approx([0, -1, 0], abs=0.05)


def test_a_room_is_drawn_from_inside_and_an_object_from_outside() -> None:
    shell = 5 * BALL / np.linalg.norm(BALL, axis=1, keepdims=True)
    dense = np.concatenate([shell, shell[shell[:, 0] > 3] * 0.99])
    inside = [looking_at(np.array([x, 0.0, 0.0]), np.array([0.1, 0, 0]), name=f"view_{x}") for x in (-9.0, 9.0)]
    assert viewpoint.choose(dense, inside).name == "view_9.0"
    assert viewpoint.choose(dense, orbit_cameras(points_of(dense, np.ones(len(dense))))).name == "overview"
    assert viewpoint.choose(dense, []).name == "overview"
