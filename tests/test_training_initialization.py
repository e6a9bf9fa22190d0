"""Where Gaussians start."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gspure.constants import SH_DC
from gspure.model.activations import sigmoid
from gspure.training.dataset import extent
from gspure.training.initialization import COMMON_SHARE, gaussians_at, random_points, thinned, view_counts
from tests.camera_cases import cameras, project
from tests.training_cases import ring, turned_away


def grey(points):
    return np.full((len(points), 3), 128, np.uint8)


@settings(max_examples=50, deadline=None)
@given(arrays(np.float64, st.tuples(st.integers(4, 30), st.just(3)), elements=st.floats(-100, 100, width=32)))
def test_a_gaussian_is_initialized_with_the_distance_to_its_three_nearest_points(points):
    squared = np.sort(np.square(points[:, None] - points[None]).sum(axis=2), axis=1)[:, 1:4].mean(axis=1)
    scales = np.exp(gaussians_at(points, grey(points)).log_scales.astype(np.float64))
    np.testing.assert_allclose(scales, np.sqrt(np.maximum(squared, 1e-7))[:, None].repeat(3, axis=1), rtol=1e-5)


def test_gaussians_have_the_colours_of_their_points():
    rng = np.random.default_rng(0)
    rgb = rng.integers(256, size=(20, 3), dtype=np.uint8)
    found = gaussians_at(rng.normal(size=(20, 3)), rgb)
    np.testing.assert_allclose(0.5 + SH_DC * found.sh_coeffs[:, 0], rgb / 255, atol=1e-6)
    assert found.sh_coeffs.shape == (20, 16, 3)
    assert not found.sh_coeffs[:, 1:].any()


def test_gaussians_start_without_rotation_at_low_opacity():
    points = np.random.default_rng(1).normal(size=(5, 3))
    found = gaussians_at(points, grey(points))
    np.testing.assert_array_equal(found.quats, [[1, 0, 0, 0]] * 5)
    np.testing.assert_allclose(sigmoid(found.opacity_logits), 0.1, rtol=1e-6)
    np.testing.assert_array_equal(found.means, points.astype(np.float32))
    assert {array.dtype for array in vars(found).values()} == {np.dtype(np.float32)}


def test_random_points_lie_where_many_views_overlap():
    views = ring()
    points = random_points(views, extent(views), 500, np.random.default_rng(0))
    assert points.shape == (500, 3)
    assert view_counts(points, views).min() >= COMMON_SHARE * len(views)
    cube = random_points(views, extent(views), 500, np.random.default_rng(0))
    np.testing.assert_array_equal(points, cube)


def test_there_are_no_random_points_for_views_that_do_not_overlap():
    away = [turned_away(view) for view in ring(2)]
    assert len(random_points(away, extent(away), 100, np.random.default_rng(0))) == 0


@given(cameras(), arrays(np.float64, (5, 3), elements=st.floats(-1e3, 1e3)))
def test_a_view_sees_what_projects_into_its_image(view, points):
    with np.errstate(all="ignore"):
        pixels, depths = project(view, points)
    inside = (pixels > 1e-3) & (pixels < np.array([view.width, view.height]) - 1e-3)
    outside = (pixels < -1e-3) | (pixels > np.array([view.width, view.height]) + 1e-3)
    found = view_counts(points, [view])
    assert found[inside.all(axis=1) & (depths > 0.21)].all()
    assert not found[outside.any(axis=1) | (depths < 0.19)].any()


def test_many_points_are_thinned_with_their_colours():
    xyz = np.arange(60.0).reshape(20, 3)
    few, colours = thinned(xyz, xyz.astype(np.uint8), 7, 3)
    assert len(np.unique(few, axis=0)) == 7
    np.testing.assert_array_equal(few, colours)
    np.testing.assert_array_equal(few, thinned(xyz, xyz.astype(np.uint8), 7, 3)[0])
