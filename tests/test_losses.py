"""The loss between an image and a photograph, with its gradient, against float64 and against the evaluation's SSIM."""

import numpy as np
import pytest

from gspure.metrics.image_metrics import ssim
from gspure.opencl.engine import Engine
from gspure.opencl.losses import upload_photographs
from tests.reference.losses import image_loss as reference_loss

SIZES = [(1, 1), (3, 2), (10, 11), (11, 11), (16, 5), (17, 33), (40, 6)]


@pytest.fixture
def engine(device, style):
    return Engine(device.cl_device, style)


def loss_on(engine, image, target, weight):
    """(loss, gradient) on a device."""
    (photograph,) = upload_photographs(engine, [target])
    loss, gradient = photograph.compare(engine.uploaded(image), weight)
    return loss, engine.read(gradient, image.shape, np.float32)


def pictures(height, width, channels=3, seed=0):
    """An image, which may be brighter than white, and a smooth photograph."""
    rng = np.random.default_rng(seed)
    y, x, c = np.meshgrid(*(np.arange(n) for n in (height, width, channels)), indexing="ij")
    target = 0.5 + 0.5 * np.sin(0.7 * x + 0.3 * y + 2 * c + seed)
    image = target * rng.uniform(0.5, 1.3) + 0.2 * rng.normal(size=target.shape)
    return np.maximum(image, 0).astype(np.float32), target.astype(np.float32)


@pytest.mark.parametrize("size", SIZES, ids="{0[0]}x{0[1]}".format)
def test_the_reference_is_the_evaluations_ssim_and_a_mean_difference(size):
    image, target = pictures(*size)
    assert reference_loss(image, target, 1.0)[0] == pytest.approx(1 - ssim(image, target), abs=1e-14)
    assert reference_loss(image, target, 0.0)[0] == pytest.approx(np.abs(image - target).mean(), rel=1e-6)
    mixed = 0.8 * reference_loss(image, target, 0.0)[0] + 0.2 * reference_loss(image, target, 1.0)[0]
    assert reference_loss(image, target, 0.2)[0] == pytest.approx(mixed)


@pytest.mark.parametrize("weight", [0.0, 0.2, 1.0])
def test_every_entry_of_the_references_gradient_is_a_slope(weight):
    image, target = (part.astype(np.float64) for part in pictures(7, 13, 2))
    _, gradient = reference_loss(image, target, weight)
    for place in np.ndindex(*image.shape):
        step = np.zeros_like(image)
        step[place] = 1e-6
        ahead, back = (reference_loss(image + sign * step, target, weight)[0] for sign in (1, -1))
        assert (ahead - back) / 2e-6 == pytest.approx(gradient[place], rel=1e-5, abs=1e-9)


def assert_agrees(engine, image, target, weight):
    loss, gradient = loss_on(engine, image, target, weight)
    true_loss, true_gradient = reference_loss(image, target, weight)
    assert loss == pytest.approx(true_loss, rel=2e-6, abs=1e-6)
    error = np.abs(gradient - true_gradient)
    assert error.max() < 2e-5 * np.abs(true_gradient).max() + 1e-5 / image.size
    assert error.mean() < 2e-6 * np.abs(true_gradient).mean() + 1e-6 / image.size


@pytest.mark.parametrize("weight", [0.0, 0.2, 1.0])
@pytest.mark.parametrize("size", SIZES, ids="{0[0]}x{0[1]}".format)
def test_losses_of_any_size_agree(engine, size, weight):
    """Smaller than the window, narrower than a vector, and neither."""
    assert_agrees(engine, *pictures(*size), weight)


@pytest.mark.parametrize("channels", [1, 2, 4])
def test_losses_of_any_number_of_channels_agree(engine, channels):
    assert_agrees(engine, *pictures(13, 19, channels), 0.2)


def test_black_on_black_and_white_on_black_agree(engine):
    """Where variances vanish, and where all that is left of SSIM are its constants."""
    black = np.zeros((12, 12, 3), np.float32)
    for image, target in ((black, black), (black + 1, black), (black, black + 1), (black + 1, black + 1)):
        loss, gradient = loss_on(engine, image, target, 0.2)
        true_loss, true_gradient = reference_loss(image, target, 0.2)
        assert loss == pytest.approx(true_loss, abs=1e-5)
        np.testing.assert_allclose(gradient * image.size, true_gradient * image.size, atol=2e-3, rtol=2e-3)
