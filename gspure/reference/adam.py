"""Adam (Kingma & Ba 2015, algorithm 1) with the settings of 3DGS."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.constants import ADAM_BETA1, ADAM_BETA2, ADAM_EPSILON

Float64 = NDArray[np.float64]


def adam_step(
    values: NDArray[Any],
    first: NDArray[Any],
    second: NDArray[Any],
    gradients: NDArray[Any],
    rate: float | NDArray[Any],
    step: int,
) -> tuple[Float64, Float64, Float64]:
    """Return (values, first, second moments) after step number `step`, from 1 on; all arrays of one shape."""
    gradients = np.asarray(gradients, np.float64)
    first = ADAM_BETA1 * np.asarray(first, np.float64) + (1 - ADAM_BETA1) * gradients
    second = ADAM_BETA2 * np.asarray(second, np.float64) + (1 - ADAM_BETA2) * gradients**2
    unbiased_first, unbiased_second = first / (1 - ADAM_BETA1**step), second / (1 - ADAM_BETA2**step)
    moved = np.asarray(values, np.float64) - rate * unbiased_first / (np.sqrt(unbiased_second) + ADAM_EPSILON)
    return moved, first, second
