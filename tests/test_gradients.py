"""The renderer's vjp against the reference, and its invariants, on every device, in both kernel styles."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gspure.errors import InputError
from gspure.model.gaussians import Gaussians
from gspure.renderer import Renderer
from tests.comparison import assert_gradients_agree, steady_pixels
from tests.exact import GRADIENT_OF, Exact, smooth_pixels
from tests.models import AWKWARD, UNDRAWN, blobs, camera, gaussians, joined, tilted_camera
from tests.reference.blending import render
from tests.reference.gradients import pull_back

BACKGROUND = np.array([0.1, 0.5, 0.9])
ROUNDING = {"flakes": 1e-4, "close_needles": 5e-3}
"""Tolerances of cases that float32 cannot hold better."""


def random_gradient(view, channels=3, seed=0):
    return np.random.default_rng(seed).normal(size=(view.height, view.width, channels)).astype(np.float32)


def assert_gradients_of(renderer, view, *, features=None, background=BACKGROUND, tight=1e-5):
    """Compare a vjp of random numbers with the reference, where rounding decides nothing."""
    settings = {"features": features, "background": background}
    rendered = render(renderer.model, view, "ewa", **settings)
    gradient = random_gradient(view, rendered.channels.shape[2]) * steady_pixels(rendered.margins)[..., None]
    _, pullback = renderer.vjp(view, **settings)
    expected = pull_back(renderer.model, view, gradient, **settings)
    assert_gradients_agree(pullback(gradient), expected, renderer.model, tight=tight)


def gradients(renderer, view, seed=0, **settings):
    image, pullback = renderer.vjp(view, **settings)
    return pullback(random_gradient(view, image.shape[2], seed))


def bits(found):
    return [getattr(found, field.name).tobytes() for field in fields(found)]


@pytest.mark.parametrize("case", AWKWARD)
def test_gradients_of_awkward_models_agree_with_the_reference(device, style, case):
    model, view = AWKWARD[case]()
    assert_gradients_of(Renderer(model, device, style=style), view, tight=ROUNDING.get(case, 1e-5))


@pytest.mark.parametrize("count", [1, 17, 257])
def test_gradients_of_any_number_of_gaussians_agree(device, style, count):
    assert_gradients_of(Renderer(blobs(count, count), device, style=style), tilted_camera(33, 31))


@pytest.mark.parametrize(("size", "sh_degree"), [((1, 1), 0), ((15, 17), 1), ((16, 16), 2), ((17, 15), 3)])
def test_gradients_of_any_image_size_and_degree_of_spherical_harmonics_agree(device, style, size, sh_degree):
    """One short of a tile, a tile, and one more, in both directions."""
    assert_gradients_of(Renderer(blobs(120, 1, sh_degree=sh_degree), device, style=style), tilted_camera(*size))


@pytest.mark.parametrize("channels", [1, 3, 16])
def test_gradients_of_any_number_of_features_agree(device, style, channels):
    rng = np.random.default_rng(channels)
    features = rng.normal(size=(60, channels)).astype(np.float32)
    renderer = Renderer(blobs(60, 3, sh_degree=0), device, style=style)
    assert_gradients_of(renderer, camera(33, 31), features=features, background=rng.normal(size=channels))


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**31),
    count=st.integers(1, 60),
    size=st.tuples(st.integers(1, 34), st.integers(1, 34)),
    largest=st.floats(0.05, 3.0),
    focal=st.floats(10.0, 200.0),
)
def test_gradients_of_random_scenes_agree(device, style, seed, count, size, largest, focal):
    model = blobs(count, seed, sh_degree=1, size=(0.02, largest))
    assert_gradients_of(Renderer(model, device, style=style), tilted_camera(*size, focal=focal), tight=1e-4)


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**31), name=st.sampled_from(sorted(GRADIENT_OF)), largest=st.floats(0.05, 1.0))
def test_gradients_are_slopes_of_random_scenes(device, style, seed, name, largest):
    """Straight from float64 finite differences of the reference's image, past its own backward pass."""
    model, view = blobs(20, seed, size=(0.03, largest)), tilted_camera(24, 20, focal=30.0)
    exact = Exact.of(model)
    gradient = random_gradient(view) * smooth_pixels(render(exact, view, "ewa").margins)[..., None]
    _, pullback = Renderer(model, device, style=style).vjp(view)
    direction = exact.natural_direction(name, np.random.default_rng(seed))
    terms = getattr(pullback(gradient), GRADIENT_OF[name]) * direction
    slope = exact.slope(name, direction, view, gradient)
    assert slope == pytest.approx(terms.sum(), abs=1e-4 * np.linalg.norm(terms) + 1e-5)


def test_gaussians_behind_the_stop_have_no_gradient(device, style):
    """Not even one left over from a view that showed it, from the side."""
    means = np.stack([np.zeros(80), np.zeros(80), np.linspace(3.0, 43.0, 80)], axis=1)
    renderer = Renderer(gaussians(means=means, scales=0.3, opacities=0.98), device, style=style)
    side = np.array([[0.0, 0, 1, -23], [0, 1, 0, 0], [-1, 0, 0, 45], [0, 0, 0, 1]])
    assert gradients(renderer, camera(17, 17, focal=17.0, viewmat=side)).opacities.all()
    found = gradients(renderer, camera(17, 17, focal=300.0))
    for field in fields(found):
        assert not getattr(found, field.name)[8:].any(), field.name
    assert found.opacities[:2].all()


@pytest.mark.parametrize("columns", [*UNDRAWN, {"x": 0.0, "y": 0.0, "z": 0.0}], ids=" ".join)
def test_a_row_that_is_not_drawn_has_no_gradient_and_leaves_no_trace(device, style, columns):
    """No Gaussian at all, or one at the camera's centre."""
    model, view = blobs(17, 4), camera(33, 31)
    broken = model.with_columns({"opacity": 3.0} | columns)[np.arange(17) < 3]
    alone = gradients(Renderer(model, device, style=style), view)
    among = gradients(Renderer(joined(model, broken), device, style=style), view)
    for field in fields(alone):
        found = getattr(among, field.name)
        assert found[:17].tobytes() == getattr(alone, field.name).tobytes(), field.name
        assert not found[17:].any(), field.name


def test_the_image_of_a_vjp_is_the_image(device, style):
    model, view = blobs(60, 3), tilted_camera(33, 31)
    renderer, features = Renderer(model, device, style=style), model.means
    assert np.array_equal(renderer.vjp(view, background=BACKGROUND)[0], renderer.image(view, BACKGROUND))
    assert np.array_equal(renderer.vjp(view, features)[0], renderer.feature_map(view, features))


@pytest.mark.parametrize("budget", [1, 100, 600])
def test_bands_give_the_same_gradients(device, style, budget):
    """Small Gaussians, which not every band shows."""
    model, view = blobs(257, 8, sh_degree=0, size=(0.01, 0.05)), tilted_camera(65, 128, focal=100.0)
    whole, banded = (Renderer(model, device, style=style, **settings) for settings in ({}, {"entry_budget": budget}))
    expected = bits(gradients(whole, view))
    _, pullback = banded.vjp(view)
    assert bits(pullback(random_gradient(view))) == expected
    assert bits(pullback(random_gradient(view))) == expected


def test_a_pullback_ends_with_the_renderers_next_image(device):
    renderer, view = Renderer(blobs(3), device), camera(8, 8)
    _, pullback = renderer.vjp(view)
    renderer.image(view)
    with pytest.raises(RuntimeError, match="another image"):
        pullback(random_gradient(view))


def test_a_gradient_of_another_shape_energy_or_without_value_is_refused(device):
    _, pullback = Renderer(blobs(3), device).vjp(camera(8, 9))
    with pytest.raises(ValueError, match=r"\(8, 9, 3\).*\(9, 8, 3\)"):
        pullback(np.ones((8, 9, 3), np.float32))
    with pytest.raises(InputError, match="finite"):
        pullback(np.full((9, 8, 3), np.nan))
    with pytest.raises(ValueError, match="ewa"):
        Renderer(blobs(3), device, energy="ray").vjp(camera(8, 9))


def test_a_vjp_needs_colours_or_features_for_each_row(device):
    table = blobs(3).table
    renderer = Renderer(Gaussians(table[[name for name in table.dtype.names if not name.startswith("f_")]]), device)
    assert renderer.vjp(camera(8, 8), np.ones((3, 2), np.float32))[0].shape == (8, 8, 2)
    with pytest.raises(InputError, match="f_dc_0"):
        renderer.vjp(camera(8, 8))
    with pytest.raises(ValueError, match="features"):
        renderer.vjp(camera(8, 8), np.ones((4, 2), np.float32))
    with pytest.raises(ValueError, match="background"):
        renderer.vjp(camera(8, 8), np.ones((3, 2), np.float32), background=[0.0])
