"""The parts of training: schedule, initial Gaussians, output, checkpoints."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gspure.constants import SH_DC
from gspure.errors import InputError
from gspure.model.gaussians import sigmoid
from gspure.training.dataset import extent
from gspure.training.initialization import COMMON_SHARE, consistent_points, gaussians_at, random_points, view_counts
from gspure.training.output import Snapshot, read_checkpoint, write_checkpoint
from gspure.training.schedule import Schedule
from tests.training_cases import ring, same_bits, state

lengths = st.integers(1, 100_000)


def times(schedule, what):
    return [i for i in range(1, schedule.iterations + 1) if getattr(schedule, what)(i)]


def test_thirty_thousand_iterations_are_scheduled_as_3dgs_does():
    schedule = Schedule.scaled(30_000)
    assert times(schedule, "densifies") == list(range(600, 15_000, 100))
    assert times(schedule, "resets_opacities") == [3000, 6000, 9000, 12_000]
    assert [schedule.sh_degree(i) for i in (1, 999, 1000, 2000, 3000, 30_000)] == [0, 0, 1, 2, 3, 3]
    assert not schedule.prunes_big(3000)
    assert schedule.prunes_big(3100)


def test_the_rate_of_positions_decays_log_linearly():
    schedule = Schedule.scaled(3000)
    first, middle, last = (schedule.rates(i, extent=2.0).means for i in (0, 1500, 3000))
    np.testing.assert_allclose([first, middle, last], [3.2e-4, 3.2e-5, 3.2e-6], rtol=1e-12)


def grey(points):
    return np.full((len(points), 3), 128, np.uint8)


@settings(max_examples=50, deadline=None)
@given(arrays(np.float64, st.tuples(st.integers(4, 30), st.just(3)), elements=st.floats(-100, 100, width=32)))
def test_a_gaussian_is_initialized_with_the_distance_to_its_three_nearest_points(points):
    squared = np.sort(np.square(points[:, None] - points[None]).sum(axis=2), axis=1)[:, 1:4].mean(axis=1)
    scales = np.exp(gaussians_at(points, grey(points)).log_scales.astype(np.float64))
    np.testing.assert_allclose(scales, np.sqrt(np.maximum(squared, 1e-7))[:, None].repeat(3, axis=1), rtol=1e-5)


def test_gaussians_start_with_the_colours_of_their_points_without_rotation_at_low_opacity():
    rng = np.random.default_rng(0)
    rgb = rng.integers(256, size=(20, 3), dtype=np.uint8)
    points = rng.normal(size=(20, 3))
    initial = gaussians_at(points, rgb)
    np.testing.assert_array_equal(initial.means, points.astype(np.float32))
    np.testing.assert_array_equal(initial.quats, [[1, 0, 0, 0]] * 20)
    np.testing.assert_allclose(sigmoid(initial.opacity_logits), 0.1, rtol=1e-6)
    np.testing.assert_allclose(0.5 + SH_DC * initial.sh_coeffs[:, 0], rgb / 255, atol=1e-6)
    assert initial.sh_coeffs.shape == (20, 16, 3)
    assert not initial.sh_coeffs[:, 1:].any()


def test_random_points_lie_where_many_views_overlap():
    views = ring()
    points = random_points(views, extent(views), 500, np.random.default_rng(0))
    assert points.shape == (500, 3)
    assert view_counts(points, views).min() >= COMMON_SHARE * len(views)
    cube = random_points(views, extent(views), 500, np.random.default_rng(0))
    np.testing.assert_array_equal(points, cube)


def test_consistent_points_lie_at_the_surface_that_all_views_show():
    views = ring()

    def photograph(view):  # of the plane y = 0, whose colour is its place
        line, column = np.indices((view.height, view.width)) + 0.5
        pixels = np.stack([column, line, np.ones_like(line)]).reshape(3, -1)
        rays = np.linalg.inv(view.K @ view.viewmat[:3, :3]) @ pixels
        ground = view.centre[:, None] - rays * view.centre[1] / rays[1]
        return np.sin(ground / 2 + [[0], [2], [4]]).T.reshape(view.height, view.width, 3).astype(np.float32) / 2 + 0.5

    points, _ = consistent_points(views, [photograph(view) for view in views], extent(views), np.random.default_rng(0))
    anywhere = random_points(views, extent(views), len(points), np.random.default_rng(0))
    assert np.median(np.abs(points[:, 1])) < np.median(np.abs(anywhere[:, 1])) / 2


SETTINGS = {"iterations": 100, "seed": 3, "background": (0.0, 0.5, 1.0), "max_gaussians": None, "data": "abc"}


@pytest.fixture
def snapshot():
    rng = np.random.default_rng(7)
    rng.random(13)
    return Snapshot(42, state(11), (3, 1, 2), rng.bit_generator.state)


def test_a_checkpoint_read_back_is_bit_identical(tmp_path, snapshot):
    write_checkpoint(tmp_path / "checkpoint.npz", snapshot, SETTINGS)
    stored = read_checkpoint(tmp_path / "checkpoint.npz", SETTINGS)
    assert (stored.iteration, stored.pending_views, stored.rng) == (42, (3, 1, 2), snapshot.rng)
    assert same_bits(stored.state, snapshot.state)


@pytest.mark.parametrize("content", [b"", b"half", {"run": np.array("{}")}, {"run": np.array([{}], dtype=object)}])
def test_a_file_that_is_not_a_checkpoint_is_refused(tmp_path, snapshot, content):
    path = tmp_path / "checkpoint.npz"
    write_checkpoint(path, snapshot, SETTINGS)
    if isinstance(content, bytes):
        path.write_bytes(content and path.read_bytes()[:4000])
    else:
        np.savez(path, **content)
    with pytest.raises(InputError, match=r"checkpoint\.npz: [a-z.]+: expected"):
        read_checkpoint(path, SETTINGS)
