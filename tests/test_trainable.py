"""A model that learns on the device: its steps against the reference, its state, its statistics."""

from dataclasses import astuple, fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from gspure.evaluation.metrics import psnr
from gspure.model.gaussians import Gaussians
from gspure.opencl.adam import LearningRates
from gspure.opencl.trainable import Parameters, TrainableModel, TrainState
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


def photographs(seed=1):
    """Pictures of another scene."""
    rendered = [render(scene(30, seed), view, "ewa").channels for view in VIEWS]
    return [np.clip(image, 0, 1).astype(np.float32) for image in rendered]


def learner(model, device, style, **settings) -> TrainableModel:
    found = TrainableModel(TrainState.fresh(parameters(model)), device=device, style=style, **settings)
    found.set_targets(photographs())
    return found


def steps(model, numbers, **settings):
    return [model.step(VIEWS[i % 2], i % 2, RATES, **settings) for i in numbers]


def arrays(state):
    """Five arrays each of the parameters, the first moments and the second."""
    return [[getattr(part, field.name) for field in fields(part)] for part in vars(state).values()]


def bits(state):
    return [array.tobytes() for part in arrays(state) for array in part]


# --- one step ---------------------------------------------------------------------------------------------------------


def reference_step(model, view, photograph):
    """(loss, gradients of the activated parameters) of one view."""
    rendered = render(model, view, "ewa", background=BACKGROUND)
    assert steady_pixels(rendered.margins).all()
    loss, image_gradient = image_loss(rendered.channels, photograph, 0.2)
    return loss, pull_back(model, view, image_gradient, background=BACKGROUND)


@pytest.mark.parametrize("number", [0, 1])
def test_a_step_follows_the_references_gradient_of_the_loss(device, style, number):
    """Fresh moments tell it, before Adam makes all steps alike: first = 0.1 gradient, second = 0.001 gradient^2."""
    model = scene()
    loss, expected = reference_step(model, VIEWS[number], photographs()[number])
    found = learner(model, device, style)
    assert found.step(VIEWS[number], number, RATES, background=BACKGROUND) == pytest.approx(loss, rel=1e-5)
    first, second = found.state().first, found.state().second
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
    for field in fields(second):
        gradient = getattr(first, field.name) / 0.1
        np.testing.assert_allclose(getattr(second, field.name), 0.001 * gradient**2, rtol=1e-5, atol=1e-30)


def test_a_step_goes_against_the_gradient_by_the_groups_rate(device, style):
    model = scene()
    found = learner(model, device, style)
    found.step(VIEWS[0], 0, RATES)
    before, state = parameters(model), found.state()
    for name, rate in zip(("means", "quats", "log_scales", "opacity_logits"), astuple(RATES), strict=False):
        moved = getattr(state.parameters, name) - getattr(before, name)
        np.testing.assert_allclose(moved, -rate * np.sign(getattr(state.first, name)), atol=0.01 * rate)
    moved = state.parameters.sh_coeffs - before.sh_coeffs
    rates = np.where(np.arange(4) == 0, RATES.sh_dc, RATES.sh_rest)[:, None]
    np.testing.assert_allclose(moved, -rates * np.sign(state.first.sh_coeffs), atol=1e-5)


def test_steps_lead_to_the_photographs(device, style):
    truth = scene(30, 1)
    start = truth.with_columns({"opacity": truth.table["opacity"] - 0.5, "f_dc_0": 0.0, "x": truth.table["x"] + 0.02})
    found = learner(start, device, style)
    before = [psnr(found.image(view), target) for view, target in zip(VIEWS, photographs(), strict=True)]
    losses = steps(found, range(60))
    after = [psnr(found.image(view), target) for view, target in zip(VIEWS, photographs(), strict=True)]
    assert sum(losses[-2:]) < 0.5 * sum(losses[:2])
    assert (np.subtract(after, before) > 4).all()


def test_the_background_and_the_weight_of_the_loss_are_used(device, style):
    losses = [
        steps(learner(scene(), device, style), [0], **settings)[0]
        for settings in ({}, {"background": (1.0, 1.0, 1.0)}, {"ssim_weight": 1.0}, {"ssim_weight": 0.0})
    ]
    assert len(set(losses)) == 4
    assert losses[0] == pytest.approx(0.2 * losses[2] + 0.8 * losses[3], rel=1e-6)


# --- spherical harmonics by and by ------------------------------------------------------------------------------------


def test_unused_degrees_of_harmonics_are_neither_shown_nor_trained(device, style):
    """A model of degree 2, used to degree 1, is the model of degree 1."""
    rich = scene(sh_degree=2)
    poor = replace(parameters(rich), sh_coeffs=np.ascontiguousarray(rich.sh_coeffs[:, :4]))
    expected = TrainableModel(TrainState.fresh(poor), device=device, style=style)
    expected.set_targets(photographs())
    found = learner(rich, device, style)
    found.sh_degree_active = 1
    assert steps(found, range(3)) == steps(expected, range(3))
    state, small = found.state(), expected.state()
    for part, used in zip(arrays(state), arrays(small), strict=True):
        for array, other in zip(part[:4], used[:4], strict=True):
            assert array.tobytes() == other.tobytes()
        assert np.array_equal(part[4][:, :4], used[4])
    assert np.array_equal(state.parameters.sh_coeffs[:, 4:], rich.sh_coeffs[:, 4:])
    assert not state.first.sh_coeffs[:, 4:].any()
    assert not state.second.sh_coeffs[:, 4:].any()
    found.sh_degree_active = 2
    steps(found, range(1))
    assert found.state().first.sh_coeffs[:, 4:].any()


# --- state ------------------------------------------------------------------------------------------------------------


def test_a_resumed_model_is_the_undisturbed_one(device, style):
    undisturbed = learner(scene(40), device, style)
    losses = steps(undisturbed, range(6))
    begun = learner(scene(40), device, style)
    assert steps(begun, range(3)) == losses[:3]
    resumed = TrainableModel(begun.state(), begun.step_count, device=device, style=style)
    resumed.set_targets(photographs())
    assert steps(resumed, range(3, 6)) == losses[3:]
    assert bits(resumed.state()) == bits(undisturbed.state())
    begun.replace(begun.state())
    assert steps(begun, range(3, 6)) == losses[3:]
    assert bits(begun.state()) == bits(undisturbed.state())


def test_replacing_changes_the_number_of_gaussians(device, style):
    model = learner(scene(40), device, style)
    steps(model, range(2))
    state = model.state()
    fewer = TrainState(*(Parameters(*(array[::3] for array in part)) for part in arrays(state)))
    model.replace(fewer)
    fresh = TrainableModel(fewer, 2, device=device, style=style)
    fresh.set_targets(photographs())
    assert model.count == 14
    assert steps(model, range(2)) == steps(fresh, range(2))
    assert bits(model.state()) == bits(fresh.state())


def test_an_image_is_that_of_the_parameters(device, style):
    model = scene(40)
    expected = render(model, VIEWS[1], "ewa", background=BACKGROUND)
    image = learner(model, device, style).image(VIEWS[1], BACKGROUND)
    np.testing.assert_allclose(
        image[steady_pixels(expected.margins)], expected.channels[steady_pixels(expected.margins)], atol=1e-4
    )


# --- statistics -------------------------------------------------------------------------------------------------------


def test_statistics_add_up_gradients_of_centres_in_units_of_the_image(device, style):
    model = scene()
    rates = LearningRates(*[0.0] * 6)
    found = learner(model, device, style)
    expected = np.zeros(len(model))
    for number in (0, 1, 0):
        found.step(VIEWS[number], number, rates, background=BACKGROUND)
        _, gradients = reference_step(model, VIEWS[number], photographs()[number])
        expected += np.hypot(*(gradients.means2d * [12.0, 10.0]).T)  # half of 24 x 20 pixels
    norms = found.statistics().gradient_norms
    np.testing.assert_allclose(norms, expected, rtol=1e-3, atol=1e-4 * expected.max())
    found.reset_statistics()
    assert not found.statistics().gradient_norms.any()
    assert not found.statistics().views.any()


def test_views_are_counted_where_a_gaussian_is_in_sight(device, style):
    model = scene(17)
    behind = model.with_columns({"z": -model.table["z"]})
    both = Gaussians(np.concatenate([model.table, behind.table]))
    found = learner(both, device, style)
    steps(found, [0, 0, 0])
    seen = render(both, VIEWS[0], "ewa").pixels > 0
    views = found.statistics().views
    assert (views[seen] == 3).all()
    assert seen.sum() > 10
    assert not views[17:].any()
    assert not found.statistics().gradient_norms[17:].any()
    found.replace(found.state())
    assert not found.statistics().views.any()
