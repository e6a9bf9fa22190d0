"""Training on the device: losses and steps by their float64 twins, twins of a scene and its message."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gspure.metrics.image_metrics import ssim
from gspure.model.gaussians import Gaussians
from gspure.opencl.adam import LearningRates
from gspure.opencl.engine import Engine
from gspure.opencl.losses import upload_photographs
from gspure.opencl.trainable import Parameters, TrainableModel, TrainState, TwinModel
from tests.comparison import assert_gradients_agree, steady_pixels
from tests.models import blobs, camera, tilted_camera
from tests.reference.blending import render
from tests.reference.gradients import pull_back
from tests.reference.losses import image_loss

RATES = LearningRates(means=2e-3, quats=1e-3, scales=5e-3, opacities=0.05, sh_dc=1e-2, sh_rest=1e-3)
VIEWS = [camera(24, 20, focal=25.0), tilted_camera(24, 20, focal=25.0)]
BACKGROUND = (0.1, 0.5, 0.9)


def scene(count=20, seed=2, *, sh_degree=1) -> Gaussians:
    """Gaussians that are neither faint nor saturated."""
    model = blobs(count, seed, sh_degree=sh_degree, size=(0.1, 0.5))
    return model.with_columns({"opacity": np.clip(model.table["opacity"], -3, 3)})


def parameters(model) -> Parameters:
    scales, logits = model.columns("scale_0", "scale_1", "scale_2"), model.columns("opacity")[:, 0]
    return Parameters(model.means, model.quats, scales, logits, model.sh_coeffs)


def photographs():
    """Pictures of another scene."""
    rendered = [render(scene(30, seed=1), view, "ewa").channels for view in VIEWS]
    return [np.clip(image, 0, 1).astype(np.float32) for image in rendered]


def learner(begin: Parameters, device, style) -> TrainableModel:
    found = TrainableModel(TrainState.fresh(begin), device=device, style=style)
    found.set_targets(photographs())
    return found


def steps(model, numbers, **settings):
    return [model.step(VIEWS[i % 2], i % 2, RATES, **settings) for i in numbers]


def reference_step(model, view, photograph):
    """(loss, gradients of the activated parameters) of one view."""
    rendered = render(model, view, "ewa", background=BACKGROUND)
    assert steady_pixels(rendered.margins).all()
    loss, image_gradient = image_loss(rendered.channels, photograph, 0.2)
    return loss, pull_back(model, view, image_gradient, background=BACKGROUND)


@pytest.mark.parametrize("number", [0, 1])
def test_a_step_follows_the_references_gradient_of_the_loss(device, style, number):
    """Fresh moments tell it, before Adam makes all steps alike: first = 0.1 gradient."""
    model = scene()
    loss, expected = reference_step(model, VIEWS[number], photographs()[number])
    found = learner(parameters(model), device, style)
    assert found.step(VIEWS[number], number, RATES, background=BACKGROUND) == pytest.approx(loss, rel=1e-5)
    first = found.state().first
    opacities = model.opacities.astype(np.float64)
    actual = SimpleNamespace(
        means=first.means / 0.1,
        quats=first.quats / 0.1,
        scales=first.log_scales / 0.1 / model.scales,
        opacities=first.opacity_logits / 0.1 / (opacities * (1 - opacities)),
        channels=first.sh_coeffs / 0.1,
        means2d=expected.means2d,
    )
    assert_gradients_agree(actual, expected, model, tight=2e-5)


def test_unused_degrees_of_harmonics_are_neither_shown_nor_trained(device, style):
    """A model of degree 2, used to degree 1, is the model of degree 1."""
    rich = scene(sh_degree=2)
    poor = replace(parameters(rich), sh_coeffs=np.ascontiguousarray(rich.sh_coeffs[:, :4]))
    expected = learner(poor, device, style)
    found = learner(parameters(rich), device, style)
    found.sh_degree_active = 1
    assert steps(found, range(3)) == steps(expected, range(3))
    state, small = found.state().parameters, expected.state().parameters
    assert state.means.tobytes() == small.means.tobytes()
    assert np.array_equal(state.sh_coeffs[:, :4], small.sh_coeffs)
    assert np.array_equal(state.sh_coeffs[:, 4:], rich.sh_coeffs[:, 4:])
    found.sh_degree_active = 2
    steps(found, range(1))
    assert found.state().first.sh_coeffs[:, 4:].any()


def test_statistics_add_up_gradients_of_centres_in_units_of_the_image(device, style):
    model = scene()
    rates = LearningRates(*[0.0] * 6)
    found = learner(parameters(model), device, style)
    expected = np.zeros(len(model))
    for number in (0, 1, 0):
        found.step(VIEWS[number], number, rates, background=BACKGROUND)
        _, gradients = reference_step(model, VIEWS[number], photographs()[number])
        expected += np.hypot(*(gradients.means2d * [12.0, 10.0]).T)  # half of 24 x 20 pixels
    norms = found.statistics().gradient_norms
    np.testing.assert_allclose(norms, expected, rtol=1e-3, atol=1e-4 * expected.max())
    found.replace(found.state())
    assert not found.statistics().gradient_norms.any()
    assert not found.statistics().views.any()


def test_twins_train_like_one_model_on_the_sum_of_both_losses(device, style):
    begin, weight = parameters(scene()), 0.5
    model = TwinModel((TrainState.fresh(begin), TrainState.fresh(begin)), weight, device, style)
    model.set_targets(photographs(), photographs())
    alone = learner(begin, device, style)
    for i in range(2):
        loss = model.step((VIEWS[i],) * 2, (i,) * 2, RATES)
        assert loss == pytest.approx((1 + weight) * alone.step(VIEWS[i], i, RATES), rel=1e-5)
    # Adam does not see the size of a gradient, the statistics do.
    np.testing.assert_allclose(model.states()[0].parameters.means, alone.state().parameters.means, atol=1e-5)
    both, one = model.models[0].statistics(), alone.statistics()
    np.testing.assert_allclose(both.gradient_norms, (1 + weight) * one.gradient_norms, rtol=1e-3, atol=1e-9)
    assert (both.views == one.views).all()


SIZES = [(1, 1, 3), (3, 2, 3), (10, 11, 2), (11, 11, 3), (16, 5, 4), (17, 33, 3), (40, 6, 1)]


@pytest.fixture
def engine(device, style):
    return Engine(device.cl_device, style)


def loss_on(engine, image, target, weight):
    """(loss, gradient) on a device."""
    (photograph,) = upload_photographs(engine, [target])
    loss, gradient = photograph.compare(engine.uploaded(image), weight)
    return loss, engine.read(gradient, image.shape, np.float32)


def pictures(height, width, channels):
    """An image, which may be brighter than white, and a smooth photograph."""
    rng = np.random.default_rng(0)
    y, x, c = np.meshgrid(*(np.arange(n) for n in (height, width, channels)), indexing="ij")
    target = 0.5 + 0.5 * np.sin(0.7 * x + 0.3 * y + 2 * c)
    image = target * rng.uniform(0.5, 1.3) + 0.2 * rng.normal(size=target.shape)
    return np.maximum(image, 0).astype(np.float32), target.astype(np.float32)


@pytest.mark.parametrize("size", SIZES, ids="{0[0]}x{0[1]}x{0[2]}".format)
def test_the_reference_is_the_evaluations_ssim_and_a_mean_difference(size):
    image, target = pictures(*size)
    assert image_loss(image, target, 1.0)[0] == pytest.approx(1 - ssim(image, target), abs=1e-14)
    assert image_loss(image, target, 0.0)[0] == pytest.approx(np.abs(image - target).mean(), rel=1e-6)
    mixed = 0.8 * image_loss(image, target, 0.0)[0] + 0.2 * image_loss(image, target, 1.0)[0]
    assert image_loss(image, target, 0.2)[0] == pytest.approx(mixed)


@pytest.mark.parametrize("weight", [0.0, 0.2, 1.0])
def test_every_entry_of_the_references_gradient_is_a_slope(weight):
    image, target = (part.astype(np.float64) for part in pictures(7, 13, 2))
    _, gradient = image_loss(image, target, weight)
    for place in np.ndindex(*image.shape):
        step = np.zeros_like(image)
        step[place] = 1e-6
        ahead, back = (image_loss(image + sign * step, target, weight)[0] for sign in (1, -1))
        assert (ahead - back) / 2e-6 == pytest.approx(gradient[place], rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("weight", [0.0, 0.2, 1.0])
@pytest.mark.parametrize("size", SIZES, ids="{0[0]}x{0[1]}x{0[2]}".format)
def test_losses_of_any_size_and_number_of_channels_agree(engine, size, weight):
    """Smaller than the window, narrower than a vector, and neither."""
    image, target = pictures(*size)
    loss, gradient = loss_on(engine, image, target, weight)
    true_loss, true_gradient = image_loss(image, target, weight)
    assert loss == pytest.approx(true_loss, rel=2e-6, abs=1e-6)
    error = np.abs(gradient - true_gradient)
    assert error.max() < 2e-5 * np.abs(true_gradient).max() + 1e-5 / image.size
    assert error.mean() < 2e-6 * np.abs(true_gradient).mean() + 1e-6 / image.size


def test_black_on_black_and_white_on_black_agree(engine):
    """Where variances vanish, and where all that is left of SSIM are its constants."""
    black = np.zeros((12, 12, 3), np.float32)
    for image, target in ((black, black), (black + 1, black), (black, black + 1), (black + 1, black + 1)):
        loss, gradient = loss_on(engine, image, target, 0.2)
        true_loss, true_gradient = image_loss(image, target, 0.2)
        assert loss == pytest.approx(true_loss, abs=1e-5)
        np.testing.assert_allclose(gradient * image.size, true_gradient * image.size, atol=2e-3, rtol=2e-3)
