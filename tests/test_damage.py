"""Damage: what a customer can undo does not count, all else does; and what the attacked model no longer covers."""

import numpy as np
import pytest

from gspure.images import read_back
from gspure.metrics.damage import Shown, coverage_lost, covered, damage, fidelity
from gspure.metrics.image_metrics import psnr
from gspure.renderer import Renderer
from tests.models import blobs, camera, tilted_camera

RNG = np.random.default_rng(0)
VIEWS = [camera(48, 36, name="a"), tilted_camera(48, 36, name="b")]
PUBLIC = blobs(300)
EVERYWHERE = [np.ones((36, 48), np.bool_)] * 2


def shown(model):
    """What the views show of a model."""
    renderer = Renderer(model)
    images = [read_back(renderer.image(view).clip(0, 1)) for view in VIEWS]
    return Shown(images, [covered(renderer.transmittance(view)) for view in VIEWS])


BEFORE = Shown(shown(PUBLIC).images, EVERYWHERE)
PHOTOGRAPHS = [image + RNG.normal(0, 0.02, image.shape) for image in BEFORE.images]
NOISE = [RNG.normal(0, 0.05, image.shape) for image in BEFORE.images]


def retouched(change):
    """The renders after a change of each image, given its number."""
    return Shown([read_back(change(image, view)) for view, image in enumerate(BEFORE.images)], EVERYWHERE)


@pytest.mark.parametrize(
    ("change", "least", "most"),  # damage, dB
    [
        (lambda image, _: image, -0.01, 0.01),
        (lambda image, _: 0.6 * image, -0.01, 0.1),
        (lambda image, _: 0.7 * image + 0.1, -0.01, 0.1),
        (lambda image, _: image[..., ::-1], -0.01, 0.01),
        (lambda image, view: image * (0.7, 1.0)[view], 3.0, 20.0),  # two maps would undo it
        (lambda image, view: image + NOISE[view], 3.0, 20.0),
        (lambda image, _: np.repeat(image.mean(axis=2, keepdims=True), 3, axis=2), 3.0, 40.0),
        (lambda image, _: np.roll(image, 1, axis=1), 3.0, 40.0),
    ],
)
def test_one_map_of_colours_is_undone_and_nothing_else(change, least, most):
    attacked = retouched(change)
    levels = [[psnr(*pair) for pair in zip(PHOTOGRAPHS, each.images, strict=True)] for each in (BEFORE, attacked)]
    unregistered = np.mean(levels[0]) - np.mean(levels[1])
    assert least <= damage(PHOTOGRAPHS, BEFORE, attacked) <= min(most, unregistered + 0.02)


def test_a_hole_is_damage_and_a_changed_background_is_none():
    half = np.arange(48) < 24
    masks = [np.broadcast_to(half, (36, 48))] * 2
    holed = Shown([np.where(half[:, None], image, 0.0) for image in BEFORE.images], masks)
    assert damage(PHOTOGRAPHS, BEFORE, holed) > 10
    assert damage(PHOTOGRAPHS, BEFORE._replace(covered=masks), holed) == pytest.approx(0, abs=0.01)
    assert (coverage_lost(BEFORE, holed), coverage_lost(holed, BEFORE)) == (0.5, 0.0)
    blank = Shown(holed.images, [np.zeros((36, 48), np.bool_)] * 2)
    assert np.isnan([damage(PHOTOGRAPHS, blank, holed), fidelity(blank, holed)]).all()
    assert coverage_lost(BEFORE, blank) == 1
    assert covered(np.array([0.5, 0.51])).tolist() == [True, False]


def test_fidelity_is_the_psnr_against_the_unattacked_renders():
    assert fidelity(BEFORE, BEFORE) == np.inf
    assert fidelity(BEFORE, retouched(lambda image, _: 0.8 * image)) > 50
    noisy = retouched(lambda image, view: image + NOISE[view])
    expected = np.mean([psnr(*pair) for pair in zip(BEFORE.images, noisy.images, strict=True)])
    assert expected - 0.02 <= fidelity(BEFORE, noisy) <= expected + 1
