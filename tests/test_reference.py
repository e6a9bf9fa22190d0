"""The oracle itself, checked against analysis, against numerical integration and against its own invariants."""

import numpy as np
import pytest
import scipy.optimize
import scipy.special
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.constants import ALPHA_MAX, ALPHA_MIN, EWA_DILATION, NEAR_PLANE
from gspure.model.rotations import rotation_matrices
from tests.models import AWKWARD, blobs, camera, gaussians, joined, tilted_camera
from tests.reference.blending import render
from tests.reference.footprint import extents
from tests.reference.projection import pixel_centres, project
from tests.reference.spherical_harmonics import sh_basis, sh_colors

ENERGIES = ["ewa", "ray"]


# --- spherical harmonics ----------------------------------------------------------------------------------------------


def random_directions(count, seed=0):
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def test_the_basis_is_scipys_complex_harmonics_combined_to_real_ones():
    directions = random_directions(50)
    theta, phi = np.arccos(directions[:, 2]), np.arctan2(directions[:, 1], directions[:, 0])
    expected = []
    for degree in range(4):
        for order in range(-degree, degree + 1):
            complex_one = scipy.special.sph_harm_y(degree, abs(order), theta, phi)  # has the Condon-Shortley sign
            part = complex_one.imag if order < 0 else complex_one.real
            expected.append(part * (np.sqrt(2) if order else 1))
    np.testing.assert_allclose(sh_basis(directions), np.transpose(expected), atol=1e-14)


def test_the_basis_is_orthonormal():
    nodes, weights = np.polynomial.legendre.leggauss(8)
    phi = np.arange(16) * np.pi / 8
    z, phi = np.repeat(nodes, 16), np.tile(phi, 8)
    radius = np.sqrt(1 - z**2)
    basis = sh_basis(np.stack([radius * np.cos(phi), radius * np.sin(phi), z], axis=1))
    gram = np.einsum("ka,kb,k->ab", basis, basis, np.repeat(weights, 16) * np.pi / 8)
    np.testing.assert_allclose(gram, np.eye(16), atol=1e-13)


def test_first_degree_coefficients_act_along_minus_y_plus_z_minus_x():
    coeffs = np.zeros((1, 4, 3))
    coeffs[0, 1:] = np.eye(3)
    for axis, (channel, sign) in enumerate([(2, -1), (0, -1), (1, 1)]):
        color = sh_colors(coeffs, 7.0 * np.eye(3)[[axis]], np.zeros(3))[0]
        expected = np.full(3, 0.5)
        expected[channel] += sign * np.sqrt(3 / (4 * np.pi))
        np.testing.assert_allclose(color, np.maximum(expected, 0), atol=1e-12)


# --- energies ---------------------------------------------------------------------------------------------------------


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


def test_a_sphere_has_the_energy_of_the_distance_between_ray_and_centre():
    sigma, mean = 0.3, np.array([0.7, -0.4, 4.0])
    view = camera()
    u, v = pixel_centres(view)
    rays = np.stack([(u - 32.5) / 60, (v - 23.5) / 60, np.ones_like(u)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    distance = np.linalg.norm(np.cross(mean, rays), axis=-1)
    energy, depth = project(gaussians(means=mean, scales=sigma), view, "ray").evaluate(0, u, v)
    np.testing.assert_allclose(energy, np.exp(-0.5 * (distance / sigma) ** 2), rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(depth, (rays @ mean) * rays[..., 2], rtol=1e-6)


def footprint_ratios(pixels: float) -> tuple[float, float, float]:
    """Medians over 40 Gaussians: sums of ray over splat with and without dilation, and their peaks."""
    rng = np.random.default_rng(4)
    view = camera(160, 120, focal=140.0)
    u, v = pixel_centres(view)
    ratios = []
    for _ in range(40):
        mean = rng.uniform([-1, -0.7, 4], [1, 0.7, 6])
        scales = pixels * mean[2] / 140 * np.exp(rng.uniform(-np.log(3) / 2, np.log(3) / 2, 3))
        model = gaussians(means=mean, scales=scales, quats=rng.normal(size=4))
        rays, splats = (project(model, view, energy) for energy in ("ray", "ewa"))
        energy, splat = rays.evaluate(0, u, v)[0], splats.evaluate(0, u, v)[0]
        undilated = 2 * np.pi * np.sqrt(np.linalg.det(splats.covs2d[0] - EWA_DILATION * np.eye(2)))
        ratios.append((energy.sum() / splat.sum(), energy.sum() / undilated, energy.max() / splat.max()))
    return tuple(np.median(ratios, axis=0))


@pytest.mark.parametrize("pixels", [1.0, 2.0, 4.0])
def test_ray_and_undilated_splat_agree_within_a_percent(pixels):
    assert abs(footprint_ratios(pixels)[1] - 1) < 0.01


@pytest.mark.parametrize(("pixels", "expected"), [(0.5, 0.47), (1.0, 0.78), (2.0, 0.92), (4.0, 0.99)])
def test_the_dilation_widens_small_splats_by_the_known_ratios(pixels, expected):
    assert footprint_ratios(pixels)[0] == pytest.approx(expected, abs=0.05)


# --- footprint --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("energy", ENERGIES)
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


@pytest.mark.parametrize("energy", ENERGIES)
@pytest.mark.parametrize("case", AWKWARD)
def test_a_box_holds_every_touched_pixel(case, energy):
    model, view = AWKWARD[case]()
    projection = project(model, view, energy)
    u, v = pixel_centres(view)
    for i, box in enumerate(extents(projection)):
        touched = np.minimum(ALPHA_MAX, projection.opacities[i] * projection.evaluate(i, u, v)[0]) >= ALPHA_MIN
        if touched.any():
            assert (u[touched] >= box[0] - 1e-9).all()
            assert (v[touched] >= box[1] - 1e-9).all()
            assert (u[touched] <= box[2] + 1e-9).all()
            assert (v[touched] <= box[3] + 1e-9).all()


# --- blending ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("energy", ENERGIES)
@pytest.mark.parametrize("case", AWKWARD)
def test_weights_and_transmittance_add_up_to_one(case, energy):
    model, view = AWKWARD[case]()
    got = render(model, view, energy, features=np.ones((len(model), 1)))
    np.testing.assert_allclose(got.channels[..., 0] + got.transmittance, 1.0, atol=1e-12)
    np.testing.assert_allclose(got.sums.sum(), (1 - got.transmittance).sum(), rtol=1e-12)
    assert (got.maxima <= got.sums + 1e-15).all()
    assert (got.sums <= got.maxima * got.pixels + 1e-12).all()
    assert ((got.sums > 0) == (got.pixels > 0)).all()
    assert (got.transmittance >= 1e-4).all()


def test_the_row_breaks_ties_in_depth():
    front, back = [0.9, 0.1, 0.1], [0.1, 0.1, 0.9]
    model = gaussians(means=[[0, 0, 4]] * 2, scales=1.0, opacities=0.99, colors=[front, back])
    got = render(model, camera(), "ewa")
    np.testing.assert_allclose(got.channels[23, 32], 0.99 * np.array(front) + 0.0099 * np.array(back), atol=1e-3)
    assert got.margins.order[23, 32] == 0


@pytest.mark.parametrize("energy", ENERGIES)
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


@pytest.mark.parametrize("energy", ENERGIES)
def test_gaussians_behind_others_do_not_change_their_contributions(energy):
    model, view = blobs(30, 6, sh_degree=0), camera()
    with_it = joined(model, gaussians(means=[[0, 0, -3], [0.1, 0, -0.5]], scales=2.0, opacities=0.9))
    np.testing.assert_array_equal(
        render(model, view, energy).transmittance, render(with_it, view, energy).transmittance
    )


def test_margins_find_the_pixels_on_the_cut_off():
    model = gaussians(means=[0, 0, 4], scales=0.4, opacities=0.9)
    view = camera()
    got = render(model, view, "ewa")
    u, v = pixel_centres(view)
    alpha = 0.9 * project(model, view, "ewa").evaluate(0, u, v)[0]
    np.testing.assert_allclose(got.margins.alpha, np.abs(255 * alpha - 1), atol=1e-6)
    assert np.isinf(got.margins.near).all()
