"""The comparison itself: it finds planted errors, and it does not look away from too much."""

import numpy as np
import pytest

from tests.comparison import assert_contributions_agree, assert_depths_agree, assert_pixels_agree, may_flip, may_swap
from tests.models import AWKWARD, blobs, tilted_camera
from tests.reference.blending import render

CONTRIBUTION = [("index", "<u4"), ("sum", "<f4"), ("max", "<f4"), ("pixels", "<u4")]


@pytest.fixture(scope="module")
def reference():
    return render(blobs(120, 1), tilted_camera(), "ewa")


def steady_pixel(reference):
    """A pixel away from every step, where something is to be seen."""
    margins = reference.margins
    steady = ~(may_flip(margins) | may_swap(margins)) & (margins.median > 0.01) & np.isfinite(reference.depth)
    return tuple(np.argwhere(steady)[0])


@pytest.mark.parametrize("energy", ["ewa", "ray"])
@pytest.mark.parametrize("case", AWKWARD)
def test_few_pixels_of_the_awkward_models_lie_on_a_step(case, energy):
    margins = render(*AWKWARD[case](), energy).margins
    on_a_step = may_flip(margins) | may_swap(margins) | (margins.median < 2.5e-4)
    assert np.count_nonzero(on_a_step) < 0.03 * on_a_step.size


def test_float32_rounding_passes(reference):
    actual = reference.channels.astype(np.float32)
    assert_pixels_agree(actual, reference.channels, reference.margins)
    assert_depths_agree(reference.depth.astype(np.float32), reference.depth, reference.margins)


def test_one_wrong_pixel_away_from_the_steps_is_found(reference):
    actual = reference.channels.copy()
    actual[steady_pixel(reference)] += 1.0 / 255
    with pytest.raises(AssertionError):
        assert_pixels_agree(actual, reference.channels, reference.margins)


def test_a_small_error_everywhere_is_found(reference):
    with pytest.raises(AssertionError):
        assert_pixels_agree(reference.channels + 2e-6, reference.channels, reference.margins)


def test_more_than_a_flip_is_found_on_a_step(reference):
    i, j = np.unravel_index(reference.margins.alpha.argmin(), reference.margins.alpha.shape)
    reference.margins.alpha[i, j] = 0.0
    actual = reference.channels.copy()
    actual[i, j] += 1.0 / 255
    assert_pixels_agree(actual, reference.channels, reference.margins)
    actual[i, j] += 0.05
    with pytest.raises(AssertionError):
        assert_pixels_agree(actual, reference.channels, reference.margins)


def test_a_wrong_or_missing_depth_is_found(reference):
    for wrong in (np.inf, 1.001 * reference.depth[steady_pixel(reference)]):
        actual = reference.depth.copy()
        actual[steady_pixel(reference)] = wrong
        with pytest.raises(AssertionError):
            assert_depths_agree(actual, reference.depth, reference.margins)


def test_a_wrong_contribution_is_found(reference):
    touched = np.flatnonzero(reference.pixels)
    stored = np.zeros(len(touched), CONTRIBUTION)
    stored["index"] = touched
    stored["sum"], stored["max"] = reference.sums[touched], reference.maxima[touched]
    stored["pixels"] = reference.pixels[touched]
    assert_contributions_agree(stored, reference)
    for field, error in (("sum", 10.0), ("max", 0.03), ("pixels", 20)):
        wrong = stored.copy()
        wrong[field][3] += np.array(error, wrong[field].dtype)
        with pytest.raises(AssertionError):
            assert_contributions_agree(wrong, reference)
    with pytest.raises(AssertionError):
        assert_contributions_agree(np.delete(stored, stored["pixels"].argmax()), reference)
