"""Opacity at points in space: against the reference and analysis, on every device at hand, in both kernel styles."""

import numpy as np
import pytest

from gspure.renderer import Renderer
from gspure.surface.meshing import first_outside
from tests.models import AWKWARD, blobs, camera, gaussians, tilted_camera
from tests.reference.opacity_field import opacities_at
from tests.reference.opacity_field import opacity_field as reference_field

STEP = 0.005
"""What one Gaussian at the cut-off, 1/255, moves an opacity."""

ROUNDING = {"needles": 2e-5, "flakes": 2e-6}
"""Mean errors of cases that float32 cannot hold better than a few 1e-7."""


def points_around(model, count=1500, seed=0):
    """Points in front of the cameras, and at and near the centres."""
    rng = np.random.default_rng(seed)
    means = model.means.astype(np.float64)
    near = means + rng.normal(0, 0.1, means.shape)
    return np.concatenate([means, near, rng.uniform([-3, -2, 0], [3, 2, 9], (count, 3))])


def assert_agrees(found, model, view, points, *, mean=1e-6):
    """Compare with the reference: tightly away from steps, where only the early end may show."""
    expected, margins = opacities_at(model, view, points)
    error, steady = np.abs(found - expected), margins > 1e-3
    assert found.shape == expected.shape
    elsewhere = np.isinf(margins)
    assert (found[elsewhere] == expected[elsewhere]).all(), "exactly 1 where the view does not show a point"
    assert (error < STEP).all()
    opaque = expected > 1 - 2e-4  # what follows there may be left out
    tight = error[steady & ~opaque]
    assert (tight < 50 * mean).all(), tight.max()
    assert tight.mean() < mean if tight.size else True
    assert (error[steady & opaque] < 1.01e-4).all()


@pytest.mark.parametrize("case", AWKWARD)
def test_awkward_models_agree_with_the_reference(device, style, case):
    model, view = AWKWARD[case]()
    points = points_around(model)
    found = Renderer(model, device, energy="ray", style=style).opacities_at(view, points)
    assert_agrees(found, model, view, points, mean=ROUNDING.get(case, 1e-6))


@pytest.mark.parametrize(("size", "count"), [((1, 1), 0), ((15, 17), 1), ((17, 15), 17), ((65, 47), 257)])
def test_any_image_size_and_number_of_points_agrees(device, style, size, count):
    model, view = blobs(120, 1), tilted_camera(*size)
    points = points_around(model)[:count]
    assert_agrees(Renderer(model, device, energy="ray", style=style).opacities_at(view, points), model, view, points)


def test_the_opacity_of_one_gaussian_is_one_half_at_the_depth_that_analysis_gives(device, style):
    """Before its centre, o exp(-(z - t)^2 / 2 s^2) = 1/2."""
    opacity, scale, z = 0.9, 0.3, 4.0
    model, view = gaussians(means=[0, 0, z], scales=scale, opacities=opacity), camera()
    surface = z - scale * np.sqrt(2 * np.log(2 * opacity))
    points = np.array([[0, 0, surface], [0, 0, z], [0, 0, z + 1]])
    for found in (
        reference_field(model, [view], points),
        Renderer(model, device, energy="ray", style=style).opacities_at(view, points),
    ):
        np.testing.assert_allclose(found, [0.5, opacity, opacity], atol=2e-6)


def test_bands_change_no_bit_and_prepared_rays_serve_sets_of_points_and_end_at_a_transmittance(device, style):
    model, view = blobs(300, 5), tilted_camera()
    points = points_around(model)
    whole = Renderer(model, device, energy="ray", style=style).opacities_at(view, points)
    banded = Renderer(model, device, energy="ray", style=style, entry_budget=500)
    assert whole.tobytes() == banded.opacities_at(view, points).tobytes()
    rays = banded.rays(view)
    early = np.concatenate([rays.opacities(part, least=0.5) for part in np.array_split(points, 3)])
    np.testing.assert_array_equal(early[whole <= 0.5], whole[whole <= 0.5])
    assert (early <= whole).all()
    assert (early < whole).any()
    assert (early[whole > 0.5] > 0.5).all()


def test_the_first_view_that_sees_a_point_outside(device, style):
    model, views = blobs(150, 8), [tilted_camera(31, 33), camera(), tilted_camera()]
    points = points_around(model)
    first = first_outside(Renderer(model, device, energy="ray", style=style), views, points)
    opacities = np.array([opacities_at(model, view, points)[0] for view in views])
    clear = (np.abs(opacities - 0.5) > STEP).all(axis=0)
    inside = np.full((1, len(points)), True)
    expected = np.concatenate([opacities < 0.5, inside]).argmax(axis=0)
    np.testing.assert_array_equal(first[clear], expected[clear])
    assert set(first) == {0, 1, 2, 3}
