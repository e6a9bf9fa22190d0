"""Contributions on one ray per Gaussian, through its centre: against the reference and analysis, in both styles."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gspure.constants import ALPHA_MAX
from gspure.method.contributions import require_valid
from gspure.method.weights import REDUCTIONS, accumulate
from gspure.renderer import Renderer
from tests.models import AWKWARD, blobs, camera, gaussians, tilted_camera
from tests.reference.blending import centre_contributions


def measured(model, view, device=None, style=None, **budget):
    records = Renderer(model, device, energy="center_ray", style=style, **budget).contributions(view)
    require_valid("view", records)
    assert (records["pixels"] == 1).all()
    assert (records["sum"] == records["max"]).all()
    contributions = np.zeros(len(model))
    contributions[records["index"]] = records["sum"]
    return contributions


def assert_agrees(model, view, device, style):
    expected, margins = centre_contributions(model, view)
    error = np.abs(measured(model, view, device, style) - expected)
    assert (error[margins > 1e-3] < 2e-5).all(), error[margins > 1e-3].max()


@pytest.mark.parametrize("case", AWKWARD)
def test_awkward_models_agree_with_the_reference(device, style, case):
    assert_agrees(*AWKWARD[case](), device, style)


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**31), count=st.integers(1, 80), size=st.integers(1, 70))
def test_random_scenes_agree(device, style, seed, count, size):
    assert_agrees(blobs(count, seed % 1000), tilted_camera(size, size + 3), device, style)


def test_behind_others_a_gaussian_contributes_what_they_let_through(device, style):
    """On one axis, omega_k = alpha_k times the product of 1 - alpha_j: each energy is 1 there."""
    model, view = gaussians(means=[[0, 0, z] for z in (4, 2, 3)], scales=0.2, opacities=[0.6, 0.5, 0.3]), camera()
    np.testing.assert_allclose(measured(model, view, device, style), [0.6 * 0.5 * 0.7, 0.5, 0.3 * 0.5], rtol=2e-6)


def test_a_gaussian_smaller_than_a_pixel_contributes_its_opacity(device, style):
    model, view = gaussians(means=[0.013, 0.007, 4], scales=1e-5, opacities=0.8), camera()
    assert not len(Renderer(model, device, energy="ray", style=style).contributions(view))
    np.testing.assert_allclose(measured(model, view, device, style), [0.8], rtol=1e-5)


@pytest.mark.parametrize("scales", [1e-7, 1e-9, 1e-13, (1e-13, 1e-13, 1.0)])
def test_the_thinnest_gaussians_contribute_what_others_let_through(device, style, scales):
    """Rounded to float32, the ray through a centre misses Gaussians that are thinner than 1e-7 of their depth."""
    x, y = np.meshgrid(np.linspace(-1.1, 1.2, 6), np.linspace(-0.9, 0.8, 5))
    means = np.column_stack([x.ravel(), y.ravel(), np.linspace(3, 4, x.size)])
    model, view = gaussians(means=means, scales=scales, opacities=0.8), camera()
    np.testing.assert_allclose(measured(model, view, device, style), centre_contributions(model, view)[0], rtol=1e-5)


def test_a_centre_outside_the_image_or_behind_the_camera_contributes_nothing(device, style):
    model = gaussians(means=[[4, 0, 4], [0, 0, -4], [0, 0, 4]], scales=1.5, opacities=0.9)
    found = measured(model, camera(), device, style)
    assert found[:2].tolist() == [0, 0]
    assert found[2] > 0


def test_bands_styles_and_a_second_run_give_the_same_bits(device):
    model, view = blobs(300, 5), tilted_camera()
    runs = [measured(model, view, device, s, entry_budget=b) for s in ("cpu", "gpu") for b in (1 << 26, 500)]
    assert (runs[0] == runs[1]).all()
    assert (runs[2] == runs[3]).all()
    np.testing.assert_allclose(runs[0], runs[2], rtol=1e-4, atol=1e-6)
    assert 0 < runs[0].max() <= np.float32(ALPHA_MAX)


def test_reductions_are_the_same_since_there_is_one_ray(device):
    model, view = blobs(50, 1), tilted_camera()
    stage = Renderer(model, device, energy="center_ray").contributions(view)
    first, *others = (accumulate([stage], 50, reduction) for reduction in REDUCTIONS)
    assert all((first == other).all() for other in others)
