"""The oracle itself: its definitions against analysis, and its gradients against finite differences."""

import numpy as np
import pytest
import scipy.optimize
import scipy.special
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.constants import ALPHA_MIN, EWA_DILATION, NEAR_PLANE
from gspure.model.rotations import rotation_matrices
from tests.exact import GRADIENT_OF, Exact, smooth_pixels
from tests.models import AWKWARD, blobs, camera, gaussians, tilted_camera
from tests.reference.blending import render
from tests.reference.footprint import extents
from tests.reference.gradients import pull_back
from tests.reference.projection import pixel_centres, project
from tests.reference.spherical_harmonics import sh_basis

BACKGROUND = np.array([0.1, 0.5, 0.9])


def test_the_basis_is_scipys_complex_harmonics_combined_to_real_ones():
    directions = np.random.default_rng(0).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    theta, phi = np.arccos(directions[:, 2]), np.arctan2(directions[:, 1], directions[:, 0])
    expected = []
    for degree in range(4):
        for order in range(-degree, degree + 1):
            complex_one = scipy.special.sph_harm_y(degree, abs(order), theta, phi)  # has the Condon-Shortley sign
            part = complex_one.imag if order < 0 else complex_one.real
            expected.append(part * (np.sqrt(2) if order else 1))
    np.testing.assert_allclose(sh_basis(directions), np.transpose(expected), atol=1e-14)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_the_ray_energy_is_the_maximum_of_the_papers_quadratic_form_along_the_ray(seed):
    rng = np.random.default_rng(seed)
    model = gaussians(
        means=rng.uniform([-1, -1, 2], [1, 1, 4]),
        scales=rng.uniform(0.1, 1.0, 3),
        quats=rng.normal(size=4),
    )
    view = tilted_camera()
    u, v = rng.uniform(5, 40, 2)
    energy, depth = project(model, view, "ray").evaluate(0, np.array(u), np.array(v))

    # in world space, with the camera centre relative to the Gaussian (paper, ray-Gaussian intersection energy)
    o = view.centre - model.means[0]
    r = view.viewmat[:3, :3].T @ np.linalg.inv(view.K) @ [u, v, 1.0]
    turned = rotation_matrices(model.quats)[0] @ np.diag(model.scales[0].astype(float))
    inverse = np.linalg.inv(turned @ turned.T)

    def exponent(t):
        return r @ inverse @ r * t**2 + 2 * o @ inverse @ r * t + o @ inverse @ o

    best = scipy.optimize.minimize_scalar(exponent, bracket=(1.0, 5.0), tol=1e-12)
    expected = np.exp(-0.5 * best.fun) if best.x > NEAR_PLANE else 0.0
    np.testing.assert_allclose(energy, expected, rtol=1e-8)
    np.testing.assert_allclose(depth, best.x, rtol=1e-5)


def test_a_sphere_on_the_axis_has_the_analytic_splat():
    sigma, z, focal = 0.2, 4.0, 60.0
    model, view = gaussians(means=[0, 0, z], scales=sigma, opacities=0.8), camera(65, 47, focal=focal)
    u, v = pixel_centres(view)
    squared = (u - 32.5) ** 2 + (v - 23.5) ** 2
    alpha = 0.8 * np.exp(-0.5 * squared / ((focal * sigma / z) ** 2 + EWA_DILATION))
    alpha[alpha < ALPHA_MIN] = 0
    got = render(model, view, "ewa")
    np.testing.assert_allclose(1 - got.transmittance, alpha, atol=1e-7)
    np.testing.assert_allclose(got.channels, 0.7 * alpha[..., None] * np.ones(3), atol=1e-7)
    assert set(np.unique(got.depth)) == {np.float64(z), np.inf}
    assert got.pixels[0] == (alpha > 0).sum()
    np.testing.assert_allclose(got.maxima[0], 0.8, rtol=1e-6)


@pytest.mark.parametrize("energy", ["ewa", "ray"])
@pytest.mark.parametrize("view", [camera(), tilted_camera()], ids=["straight", "tilted"])
def test_extents_are_tight(energy, view):
    """Sampled every 1/20 pixel, the region where alpha >= 1/255 reaches its box on every side and stays inside."""
    projection = project(blobs(30, 2, size=(0.02, 0.15)), view, energy)
    boxes = extents(projection)
    drawn = np.flatnonzero(np.isfinite(boxes).all(axis=1))
    assert len(drawn) > 15
    for i in drawn:
        left, top, right, bottom = boxes[i]
        u, v = np.meshgrid(np.arange(left - 1, right + 1, 0.05), np.arange(top - 1, bottom + 1, 0.05))
        inside = projection.opacities[i] * projection.evaluate(i, u, v)[0] >= ALPHA_MIN
        sampled = [u[inside].min(), v[inside].min(), u[inside].max(), v[inside].max()]
        reach = np.array([1, 1, -1, -1]) * (sampled - boxes[i])
        assert (reach >= -1e-9).all()
        assert (reach < 0.06).all()


def test_the_row_breaks_ties_in_depth():
    front, back = [0.9, 0.1, 0.1], [0.1, 0.1, 0.9]
    model = gaussians(means=[[0, 0, 4]] * 2, scales=1.0, opacities=0.99, colors=[front, back])
    got = render(model, camera(), "ewa")
    np.testing.assert_allclose(got.channels[23, 32], 0.99 * np.array(front) + 0.0099 * np.array(back), atol=1e-3)
    assert got.margins.order[23, 32] == 0


@pytest.mark.parametrize("energy", ["ewa", "ray"])
def test_a_pixel_stops_before_the_gaussian_that_would_darken_it_too_far(energy):
    means = [[0, 0, z] for z in (3.0, 4.0, 5.0, 6.0)]
    model = gaussians(means=means, scales=9.0, opacities=[0.99, 0.98, 0.6, 0.9])
    got = render(model, camera(1, 1), energy)  # T: 0.01, 0.0002, then 0.00008 is too dark
    np.testing.assert_allclose(got.transmittance, 0.01 * 0.02, rtol=1e-3)
    assert got.pixels.tolist() == [1, 1, 0, 0]
    np.testing.assert_allclose(got.margins.stop[0, 0], abs(0.01 * 0.02 * 0.4 / 1e-4 - 1), rtol=1e-3)


def test_the_median_depth_is_where_half_the_light_is_gone():
    means = [[0, 0, z] for z in (3.0, 4.0, 5.0)]
    model = gaussians(means=means, scales=9.0, opacities=[0.3, 0.3, 0.3])  # T: 0.7, 0.49
    assert render(model, camera(1, 1), "ewa").depth == pytest.approx(4.0)
    assert render(model, camera(1, 1), "ray").depth == pytest.approx(4.0, rel=1e-3)
    assert render(model[np.array([1, 0, 0], bool)], camera(1, 1), "ewa").depth == np.inf


@pytest.mark.parametrize("name", GRADIENT_OF)
@pytest.mark.parametrize("case", sorted(set(AWKWARD) - {"nothing", "same_depth", "close_needles", "geographic"}))
def test_a_gradient_is_the_slope_of_a_rendering(case, name):
    """All rules at once: cut-offs, stops, clamped alphas and Jacobians, colours clamped at black. No equal depths:
    any move of a mean changes their order. No coordinates of a map: they leave too few digits for a slope."""
    model, view = AWKWARD[case]()
    exact, rng = Exact.of(model[np.arange(len(model)) < 25]), np.random.default_rng(1)
    rendered = render(exact, view, "ewa", background=BACKGROUND)
    image_gradient = rng.normal(size=rendered.channels.shape) * smooth_pixels(rendered.margins)[..., None]
    direction = exact.natural_direction(name, rng)
    terms = getattr(pull_back(exact, view, image_gradient, background=BACKGROUND), GRADIENT_OF[name]) * direction
    slope = exact.slope(name, direction, view, image_gradient, background=BACKGROUND)
    assert slope == pytest.approx(terms.sum(), rel=1e-5, abs=1e-5 * np.abs(terms).max() + 1e-6)
