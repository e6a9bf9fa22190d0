"""Adam (Kingma & Ba 2015, algorithm 1) with the settings of 3DGS, on the device (adam.cl) and in numpy."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.constants import ADAM_BETA1, ADAM_BETA2, ADAM_EPSILON
from gspure.opencl.engine import Engine
from gspure.opencl.gradients import DeviceGradients

Array = NDArray[Any]


@dataclass(frozen=True)
class LearningRates:
    """Step sizes of the parameter groups; `means` in world units."""

    means: float
    quats: float
    scales: float
    opacities: float
    sh_dc: float
    sh_rest: float


@dataclass(frozen=True)
class Moments:
    """One group of parameters on the device: raw values, Adam's first and second moments."""

    raw: cl.Buffer
    first: cl.Buffer
    second: cl.Buffer


class Adam:
    """Adam over the geometry [K,GEOMETRY_ATTRIBUTES] and the colours [K,attributes] of K = `count` Gaussians.

    `activated` receives the geometry as the renderer reads it: exp of scales, logistic function of opacities.
    """

    def __init__(
        self, engine: Engine, count: int, geometry: Moments, channels: Moments, attributes: int, activated: cl.Buffer
    ) -> None:
        self.geometry = geometry
        self.channels = channels
        self.activated = activated
        self._count = count
        self._items = engine.vectors(count)
        self._rates = engine.buffers.rates
        self._program = engine.program("vector", "adam", CHANNEL_ATTRIBUTES=attributes)
        self._program.launch("activate_geometry", self._items, count, geometry.raw, activated)

    def step(self, number: int, rates: LearningRates, gradients: DeviceGradients) -> None:
        """Take step `number` (the first is 1) against the gradients of the activated values."""
        corrections = (1 / (1 - ADAM_BETA1**number), 1 / (1 - ADAM_BETA2**number))
        per_attribute = [rates.means] * 3 + [rates.quats] * 4 + [rates.scales] * 3 + [rates.opacities]
        self._program.launch(
            "adam_geometry",
            self._items,
            self._count,
            *corrections,
            self._rates.holding(np.array(per_attribute, np.float32)),
            gradients.geometry,
            self.geometry.raw,
            self.geometry.first,
            self.geometry.second,
            self.activated,
        )
        self._program.launch(
            "adam_channels",
            self._items,
            self._count,
            float(rates.sh_dc),
            float(rates.sh_rest),
            *corrections,
            gradients.channels,
            self.channels.raw,
            self.channels.first,
            self.channels.second,
        )


def adam_step(values: Array, first: Array, second: Array, gradient: Array, rate: float | Array, number: int) -> None:
    """Take step `number` (the first is 1) in numpy; change values and both moments in place, in their precision."""
    first *= ADAM_BETA1
    first += (1 - ADAM_BETA1) * gradient
    second *= ADAM_BETA2
    second += (1 - ADAM_BETA2) * np.square(gradient)
    unbiased = second / (1 - ADAM_BETA2**number)
    values -= rate / (1 - ADAM_BETA1**number) * first / (np.sqrt(unbiased) + ADAM_EPSILON)
