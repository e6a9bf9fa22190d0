import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.cameras import bounding_sphere, orbit_cameras, shell_cameras
from gspure.cameras.orbit import guessed_up
from gspure.constants import NEAR_PLANE
from gspure.errors import InputError
from gspure.figures.panels import mention_up
from tests.camera_cases import numbers, project
from tests.models import points_of

RANDOM = np.random.default_rng(1)
BALL = RANDOM.normal(size=(4000, 3))
BALL *= (RANDOM.random(4000) ** (1 / 3) / np.linalg.norm(BALL, axis=1))[:, None]
OPAQUE = np.ones(len(BALL))
UPS = st.tuples(*[numbers(-1, 1)] * 3).filter(lambda up: np.linalg.norm(up) > 0.1)


@pytest.mark.parametrize("generate", [orbit_cameras, shell_cameras])
@given(up=UPS, radius=numbers(0.01, 100), x=numbers(-50, 50))
def test_every_view_looks_at_the_model_upright(generate, up, radius, x):
    means = radius * BALL[:200] + [x, 0, 1]
    centre, _ = bounding_sphere(means, OPAQUE[:200])
    for camera in generate(points_of(means, OPAQUE[:200]), count=9, up=up):
        rotation = camera.viewmat[:3, :3]
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)
        assert project(camera, centre[None])[0][0] == pytest.approx([320, 240], abs=1e-6)
        right, down, _ = rotation
        assert right @ up == pytest.approx(0, abs=1e-12)
        assert down @ up <= 1e-12


def test_a_ball_fills_the_height_of_every_orbit_view():
    for camera in orbit_cameras(points_of(BALL, OPAQUE)):
        pixels, depths = project(camera, BALL)
        inside = (depths > NEAR_PLANE) & (pixels >= 0).all(axis=1) & (pixels <= [640, 480]).all(axis=1)
        assert inside.mean() > 0.99
        assert np.ptp(pixels[:, 1]) > 0.9 * 480


@pytest.mark.parametrize("span", [0.8, 1.6])
@pytest.mark.parametrize("up", [(0, -1, 0), (0, 0, 1)])
def test_a_figure_with_arms_spread_stands(up, span):
    """Its depth is its thinnest side; boxes are given by centre and size across, in depth and in height."""
    torso = ((0, 0, 1.15), (0.4, 0.2, 0.6))
    legs = ((0, 0, 0.45), (0.4, 0.2, 0.9))
    head = ((0, 0, 1.6), (0.2, 0.2, 0.3))
    arms = ((0, 0, 1.35), (span, 0.1, 0.1))
    boxes = np.array([torso, legs, head, arms])
    parts = [centre + size * RANDOM.uniform(-0.5, 0.5, (500, 3)) for centre, size in boxes]
    across, depth, height = np.concatenate(parts).T
    points = np.stack([across, -height, depth] if up[1] else [across, depth, height], axis=1)
    np.testing.assert_array_equal(guessed_up(points, np.ones(len(points))).direction, up)


@pytest.mark.parametrize("up", [(0, -1, 0), (0, 0, 1), (0, -0.8, 0.6)])
def test_a_flat_model_stands_on_its_flat_side(up, capsys):
    flat = BALL - 0.7 * np.outer(BALL @ up, up)
    floaters = RANDOM.normal(size=(40, 3)) * 1e4
    for points in (flat, np.concatenate([flat, floaters])):
        guessed, chosen = (
            orbit_cameras(points_of(points, np.ones(len(points))), up=direction) for direction in (None, up)
        )
        for a, b in zip(guessed, chosen, strict=True):
            assert a.numbers == pytest.approx(b.numbers, abs=0.1)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert all("--up" in line for line in lines)


def test_a_model_without_a_clear_up_direction_has_that_of_colmap():
    wall = BALL * [0.1, 1, 1]
    for points, opacities in ((BALL, OPAQUE), (wall, OPAQUE), (BALL, 0 * OPAQUE)):
        up, is_sure = guessed_up(points, opacities)
        assert up.tolist() == [0, -1, 0]
        assert not is_sure


SHAPES = {  # points, and whether the guess is sure
    "ball": (BALL, False),
    "tilted disc": (BALL - 0.9 * np.outer(BALL @ [0, -0.8, 0.6], [0, -0.8, 0.6]), False),
    "low room": (RANDOM.uniform(-1, 1, (4000, 3)) * [1, 1, 0.4], True),
    "figure on its back": (BALL * [0.4, 1, 0.2], False),
}


@pytest.mark.parametrize(("points", "is_sure"), SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("up", [None, (0, 0, 1)], ids=["guessed", "set"])
def test_the_candidates_are_drawn_if_a_guess_is_unsure(tmp_path, capsys, points, is_sure, up):
    views = []

    def draw(camera):
        views.append(camera)
        return np.zeros((camera.height, camera.width, 3), np.float32)

    mention_up(points_of(points, OPAQUE), draw, up, tmp_path)
    is_drawn = not (up or is_sure)
    assert (tmp_path / "up.png").is_file() == is_drawn
    assert ("up is unsure: see " in capsys.readouterr().err) == is_drawn
    assert len({tuple(np.round(-camera.viewmat[1, :3])) for camera in views}) == 6 * is_drawn


def test_shells_surround_the_model_at_their_radii():
    cameras = shell_cameras(points_of(BALL, OPAQUE), count=90)
    distances = np.array([np.linalg.norm(c.centre - bounding_sphere(BALL, OPAQUE)[0]) for c in cameras])
    nearest, middle, farthest = (distances[i::3] for i in range(3))
    assert middle / nearest == pytest.approx(1 / 0.6)
    assert farthest / middle == pytest.approx(1.6)
    directions = np.array([c.centre for c in cameras]) / distances[:, None]
    assert (directions @ directions.T - 2 * np.eye(90)).max(axis=1).min() > np.cos(np.radians(25))
    for axis in (*np.eye(3), *-np.eye(3)):
        assert (directions @ axis).max() > np.cos(np.radians(20))


@pytest.mark.parametrize(("name", "value"), [("count", 0), ("height", 2.5), ("fov_degrees", 180), ("up", (0, 0, 0))])
def test_a_setting_out_of_range_is_refused_by_name(name, value):
    for generate in (orbit_cameras, shell_cameras):
        with pytest.raises(InputError) as caught:
            generate(points_of(BALL, OPAQUE), **{name: value})
        assert caught.value.field == name
