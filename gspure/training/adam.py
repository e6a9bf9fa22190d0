"""Adam (Kingma & Ba 2015, algorithm 1) with the settings of 3DGS, in numpy.

For parameters that are not colours on the device, and as the oracle of `gspure.opencl.adam`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.constants import ADAM_BETA1, ADAM_BETA2, ADAM_EPSILON

Floats = NDArray[Any]


def adam_step(
    values: Floats, first: Floats, second: Floats, gradient: Floats, rate: float | Floats, number: int
) -> None:
    """Take step `number`, from 1 on; change values, first and second moments in place, in their precision."""
    first *= ADAM_BETA1
    first += (1 - ADAM_BETA1) * gradient
    second *= ADAM_BETA2
    second += (1 - ADAM_BETA2) * np.square(gradient)
    unbiased = second / (1 - ADAM_BETA2**number)
    values -= rate / (1 - ADAM_BETA1**number) * first / (np.sqrt(unbiased) + ADAM_EPSILON)
