"""The oracle of the backward pass, against finite differences of the reference's own rendering."""

from dataclasses import replace

import numpy as np
import pytest

from gspure.cameras.camera import intrinsics
from gspure.constants import ALPHA_MAX, ALPHA_MIN
from tests.exact import GRADIENT_OF, STEP, Exact, smooth_pixels
from tests.models import AWKWARD, blobs, camera, tilted_camera
from tests.reference.blending import render
from tests.reference.gradients import pull_back
from tests.reference.projection import clamped_slopes, pixel_centres, project
from tests.reference.spherical_harmonics import sh_basis, sh_basis_gradients, sh_colors

BACKGROUND = np.array([0.1, 0.5, 0.9])


def random_gradient(rendered, seed=0):
    """dL/dimage that is zero where a step or a kink is near."""
    gradient = np.random.default_rng(seed).normal(size=rendered.channels.shape)
    return gradient * smooth_pixels(rendered.margins)[..., None]


def first_rows(case):
    model, view = AWKWARD[case]()
    return model[np.arange(len(model)) < 25], view


def clamps_of(model, view):
    """Which clamps are active in what a view shows."""
    splats, drawn = project(model, view, "ewa"), render(model, view, "ewa")
    shown = drawn.sums[splats.rows] > 0
    slopes = splats.means[:, :2] / splats.means[:, 2:]
    energies = np.array([splats.evaluate(i, *pixel_centres(view))[0] for i in range(len(shown))])
    alphas = splats.opacities[:, None, None] * energies
    return {
        "Jacobian": (slopes != clamped_slopes(splats.means, view))[shown].any(),
        "alpha": (alphas > ALPHA_MAX).any(),
        "colour": (sh_colors(model.sh_coeffs, model.means, view.centre)[splats.rows[shown]] == 0).any(),
        "stop": ((alphas >= ALPHA_MIN).sum(axis=(1, 2)) > drawn.pixels[splats.rows]).any(),
    }


@pytest.mark.parametrize("name", GRADIENT_OF)
@pytest.mark.parametrize("case", sorted(set(AWKWARD) - {"nothing", "same_depth", "close_needles", "geographic"}))
def test_a_gradient_is_the_slope_of_a_rendering(case, name):
    """All rules at once: cut-offs, stops, clamped alphas and Jacobians, colours clamped at black. No equal depths:
    any move of a mean changes their order. No coordinates of a map: they leave too few digits for a slope."""
    model, view = first_rows(case)
    exact, rng = Exact.of(model), np.random.default_rng(1)
    image_gradient = random_gradient(render(exact, view, "ewa", background=BACKGROUND))
    direction = exact.natural_direction(name, rng)
    terms = getattr(pull_back(exact, view, image_gradient, background=BACKGROUND), GRADIENT_OF[name]) * direction
    slope = exact.slope(name, direction, view, image_gradient, background=BACKGROUND)
    assert slope == pytest.approx(terms.sum(), rel=1e-5, abs=1e-5 * np.abs(terms).max() + 1e-6)


@pytest.mark.parametrize("name", GRADIENT_OF)
def test_every_entry_is_a_slope(name):
    exact, view = Exact.of(blobs(3, 4, size=(0.1, 0.6))), tilted_camera(7, 5, focal=6.0)
    image_gradient = random_gradient(render(exact, view, "ewa"))
    gradient = getattr(pull_back(exact, view, image_gradient), GRADIENT_OF[name])
    directions = np.eye(gradient.size).reshape(-1, *gradient.shape)
    slopes = [exact.slope(name, direction, view, image_gradient) for direction in directions]
    np.testing.assert_allclose(gradient.ravel(), slopes, rtol=1e-6, atol=2e-7)
    assert (gradient != 0).mean() > 0.9


@pytest.mark.parametrize("channels", [1, 4])
def test_features_have_gradients_as_colours_have(channels):
    rng = np.random.default_rng(2)
    exact, view = Exact.of(blobs(12, 5, sh_degree=0, size=(0.1, 0.6))), tilted_camera(12, 9, focal=12.0)
    features, background = rng.normal(size=(12, channels)), rng.normal(size=channels)
    rendered = render(exact, view, "ewa", features, background)
    image_gradient = random_gradient(rendered)
    found = pull_back(exact, view, image_gradient, features, background)
    move = rng.normal(size=features.shape)
    ahead, back = (render(exact, view, "ewa", features + step * move, background).channels for step in (STEP, -STEP))
    slope = ((ahead - back) * image_gradient).sum() / (2 * STEP)
    assert (found.channels * move).sum() == pytest.approx(slope, rel=1e-6)
    direction = exact.natural_direction("opacities", rng)
    slope = exact.slope("opacities", direction, view, image_gradient, features=features, background=background)
    assert (found.opacities * direction).sum() == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("axis", [0, 1])
def test_centres_move_with_the_principal_point(axis):
    """A shift of it moves all projected centres alike and, where no Jacobian is clamped, nothing else."""
    exact, view = Exact.of(blobs(20, 6, sh_degree=0, size=(0.1, 0.9))), camera(40, 30, focal=20.0)
    assert not clamps_of(exact, view)["Jacobian"]
    image_gradient = random_gradient(render(exact, view, "ewa"))

    def image(shift):
        K = intrinsics(20.0, 20.0, *(view.K[:2, 2] + shift * np.eye(2)[axis]))
        return render(exact, replace(view, K=K), "ewa").channels

    slope = ((image(STEP) - image(-STEP)) * image_gradient).sum() / (2 * STEP)
    assert pull_back(exact, view, image_gradient).means2d[:, axis].sum() == pytest.approx(slope, rel=1e-6)


def test_basis_gradients_are_slopes_of_the_basis():
    directions = np.random.default_rng(3).normal(size=(20, 3))
    for axis, step in enumerate(STEP * np.eye(3)):
        slopes = (sh_basis(directions + step) - sh_basis(directions - step)) / (2 * STEP)
        np.testing.assert_allclose(sh_basis_gradients(directions)[..., axis], slopes, atol=1e-6)


@pytest.mark.parametrize(
    ("clamp", "case"),
    [("Jacobian", "off_screen"), ("alpha", "covering"), ("colour", "off_centre"), ("stop", "stacked")],
)
def test_the_cases_reach_every_clamp(clamp, case):
    """Else agreement with finite differences would say nothing about it."""
    model, view = first_rows(case)
    assert clamps_of(model, view)[clamp]
