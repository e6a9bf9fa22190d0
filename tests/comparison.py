"""Two-tier comparison of a rendering with the reference.

The rules of blending have steps: the cut-off at alpha = 1/255, the stop at T < 1e-4, the order of two depths. Close to
a step, float32 may decide otherwise than float64 and differ by a finite, known amount. So pixels away from every step
must agree tightly, in the mean, in a high quantile and at worst; pixels in the band around a step may differ by what
flips can do. A maximum norm alone would either miss errors or fail at random.

`tight` scales all of it: the rounding errors that the case at hand admits, as a share of the spread of the values.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools
from gspure.model import Gaussians
from gspure.renderer import Gradients
from tests.reference.blending import Margins, Reference

Array = NDArray[Any]

FLIP = 0.02
"""What a few flips at the cut-off (1/255 each) or one at the stop (0.01) move a pixel, relative to the spread."""

TIGHT = 5e-6
"""The largest error of 99 % of the pixels, relative to the spread; of the mean, a fifth, and of the worst, 20 times."""

DEPTH_ROUNDING = 5e-6
"""Relative rounding of view depths, which decide the order and the near plane."""


def may_flip(margins: Margins, tight: float = TIGHT) -> Bools:
    """Pixels where an alpha or a transmittance may fall to a step's other side."""
    return np.minimum(margins.alpha, margins.stop) < 50 * tight


def may_swap(margins: Margins) -> Bools:
    """Pixels where two Gaussians may come in the other order, or one fall to the near plane's other side.

    Equal depths are no risk: the row decides.
    """
    return ((margins.order > 0) & (margins.order < DEPTH_ROUNDING)) | (margins.near < DEPTH_ROUNDING)


def assert_pixels_agree(
    actual: Array, expected: Array, margins: Margins, *, spread: float = 1.0, tight: float = TIGHT
) -> None:
    """Compare pixels [H,W] or [H,W,C]; `spread` is the largest minus the smallest value that is blended."""
    assert actual.shape == expected.shape
    assert np.isfinite(actual).all()
    error = np.abs(actual - expected).reshape(*margins.alpha.shape, -1).max(axis=2, initial=0.0) / spread
    flips, swaps = may_flip(margins, tight), may_swap(margins)
    assert_tight(error[~(flips | swaps)], tight)
    assert (error[~swaps] < max(FLIP, 20 * tight)).all(), f"largest error at a step {error[~swaps].max():.2e}"


def assert_depths_agree(actual: Array, expected: Array, margins: Margins, *, tight: float = TIGHT) -> None:
    """Compare median depths [H,W]: a flip may pick another Gaussian, so pixels in the band are only counted."""
    assert actual.shape == expected.shape
    steady = ~(may_flip(margins, tight) | may_swap(margins) | (margins.median < 50 * tight))
    assert np.array_equal(np.isinf(actual[steady]), np.isinf(expected[steady])), "a median depth or none"
    finite = steady & np.isfinite(expected)
    assert_tight(np.abs(actual[finite] / expected[finite] - 1), tight)


def assert_contributions_agree(actual: Array, reference: Reference, *, tight: float = TIGHT) -> None:
    """Compare stored contributions with the reference's sums, maxima and pixel counts of all K Gaussians."""
    assert (np.diff(actual["index"].astype(np.int64)) > 0).all(), "indices in order, none twice"
    assert (actual["pixels"] > 0).all(), "only touched Gaussians"
    dense = np.zeros(len(reference.sums), actual.dtype)
    dense[actual["index"]] = actual
    touched = np.maximum(reference.pixels, 1)
    for error in (np.abs(dense["sum"] - reference.sums) / touched, np.abs(dense["max"] - reference.maxima)):
        assert error.sum() <= tight * error.size
        assert (error < max(FLIP, 20 * tight)).all()
    flipped = np.abs(dense["pixels"].astype(np.int64) - reference.pixels)
    undecided = np.count_nonzero(reference.margins.near < DEPTH_ROUNDING)
    assert flipped.sum() <= 1 + undecided + 50 * tight * reference.pixels.sum(), f"{flipped.sum()} pixels differ"


def steady_pixels(margins: Margins, tight: float = TIGHT) -> Bools:
    """Pixels [H,W] whose gradient does not hang on rounding: no step is near, nor the kink where alpha is clamped."""
    return ~(may_flip(margins, tight) | may_swap(margins) | (margins.clamp < 50 * tight))


def assert_gradients_agree(actual: Gradients, expected: Gradients, model: Gaussians, *, tight: float = 1e-5) -> None:
    """Compare gradients of a loss on `steady_pixels` row by row, relative to the row's size and a little of others'.

    A round Gaussian's quaternion has no gradient, as the sum of turns that would each change its shape; so a row's size
    is there also that of its scales' gradient.
    """
    turns = np.linalg.norm(expected.scales * model.scales, axis=1) / np.linalg.norm(model.quats, axis=1)
    for name in ("means", "quats", "scales", "opacities", "channels", "means2d"):
        found, true = getattr(actual, name), getattr(expected, name)
        assert found.shape == true.shape, name
        assert np.isfinite(found).all(), name
        if not true.size:
            continue
        error, size = (np.linalg.norm(part.reshape(len(model), -1), axis=1) for part in (found - true, true))
        size = size + (turns if name == "quats" else 0.0)
        relative = error / (size + 0.01 * np.sqrt((size**2).mean()) + 1e-12)
        mean, worst = relative.mean(), relative.max()
        assert (mean < tight) & (worst < 50 * tight), f"{name}: {mean:.2e}, {worst:.2e} in row {relative.argmax()}"


def assert_tight(errors: Array, tight: float) -> None:
    """Bound the mean, the 99 % quantile and the maximum."""
    if errors.size:
        mean, high, worst = errors.mean(), np.quantile(errors, 0.99), errors.max()
        assert (mean < tight / 5) & (high < tight) & (worst < 20 * tight), f"{mean:.2e}, {high:.2e}, {worst:.2e}"
