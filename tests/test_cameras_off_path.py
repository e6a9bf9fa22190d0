"""Views beside the path of the cameras."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.cameras import Camera, intrinsics, off_path_cameras, orbit_cameras, split
from gspure.errors import InputError
from gspure.scenes.photography import path_cameras
from tests.models import points_of
from tests.training_cases import ring


def lines_meet(a, b):
    """The distance between two optical axes."""
    across = np.cross(a.viewmat[2, :3], b.viewmat[2, :3])
    between = b.centre - a.centre
    if np.linalg.norm(across) < 1e-9:
        return float(np.linalg.norm(np.cross(between, a.viewmat[2, :3])))
    return float(abs(between @ across) / np.linalg.norm(across))


@given(st.integers(1, 12))
def test_off_path_views_are_beside_the_path_and_look_at_the_same_target(count):
    path = path_cameras(32, 64, 48)
    train, _ = split(path)
    centres = np.array([camera.centre for camera in train])
    spread = np.sqrt(((centres - centres.mean(axis=0)) ** 2).sum(axis=1).mean())
    views = off_path_cameras(path, count)
    assert [view.name for view in views] == [f"off_path_{i:03d}" for i in range(count)]
    for i, view in enumerate(views):
        start = train[i * len(train) // count]
        assert np.linalg.norm(view.centre - start.centre) == pytest.approx(0.25 * spread)
        assert lines_meet(view, start) < 1e-9
        np.testing.assert_allclose(view.viewmat[:3, :3] @ view.viewmat[:3, :3].T, np.eye(3), atol=1e-12)
        assert (view.width, view.height) == (start.width, start.height)
        assert abs(view.viewmat[0, 2]) < 0.2  # still upright


def test_off_path_views_of_an_orbit_are_off_its_ring():
    path = orbit_cameras(points_of(np.eye(3), np.ones(3)), count=72)[::3]  # one of three rings
    heights = np.array([camera.centre[1] for camera in path])
    assert np.ptp(heights) < 1e-9
    assert all(abs(view.centre[1] - heights[0]) > 0.1 for view in off_path_cameras(path, 8))


def test_cameras_that_look_outwards_have_views_of_what_is_before_them():
    turned = np.diag([-1.0, 1.0, -1.0, 1.0])
    path = [replace(camera, viewmat=turned @ camera.viewmat) for camera in ring(16)]
    train, _ = split(path)
    for i, view in enumerate(off_path_cameras(path, 4)):
        assert view.viewmat[2, :3] @ train[i * len(train) // 4].viewmat[2, :3] > 0.5


@pytest.mark.parametrize("path", [[], ring(1), [*ring(9), *off_path_cameras(ring(9), 1)]], ids=["none", "one", "aside"])
def test_a_camera_path_of_one_place_is_refused(path):
    with pytest.raises(InputError, match=r"two or more.*found (off_path_000|[01] in one place) \(off_path: 0 "):
        off_path_cameras(path, 2)


def test_one_place_is_no_path():
    K = intrinsics(10, 10, 8, 6)
    with pytest.raises(InputError):
        off_path_cameras([Camera(f"v{i}", 16, 12, K, np.eye(4)) for i in range(4)], 2)
