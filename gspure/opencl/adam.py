"""Adam (Kingma & Ba 2015, algorithm 1) with the settings of 3DGS: of a model on the device (adam.cl), and in numpy."""

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
        self.geometry, self.channels, self.activated = geometry, channels, activated
        self._count, self._items = count, engine.vectors(count)
        self._rates = engine.buffers.rates
        self._program = engine.program("vector", "adam", CHANNEL_ATTRIBUTES=attributes)
        self._program.launch("activate_geometry", self._items, count, geometry.raw, activated)

    def step(self, number: int, rates: LearningRates, gradients: DeviceGradients) -> None:
        """Take step `number`, from 1 on, against the gradients of the activated values."""
        corrections = (1 / (1 - ADAM_BETA1**number), 1 / (1 - ADAM_BETA2**number))
        per_attribute = [rates.means] * 3 + [rates.quats] * 4 + [rates.scales] * 3 + [rates.opacities]
        geometry, channels = self.geometry, self.channels
        self._program.launch(
            "adam_geometry",
            self._items,
            *(self._count, *corrections, self._rates.holding(np.array(per_attribute, np.float32))),
            *(gradients.geometry, geometry.raw, geometry.first, geometry.second, self.activated),
        )
        settings = (self._count, float(rates.sh_dc), float(rates.sh_rest), *corrections)
        moments = (gradients.channels, channels.raw, channels.first, channels.second)
        self._program.launch("adam_channels", self._items, *settings, *moments)


def adam_step(values: Array, first: Array, second: Array, gradient: Array, rate: float | Array, number: int) -> None:
    """Take step `number`, from 1 on, in numpy; change values and both moments in place, in their precision."""
    first *= ADAM_BETA1
    first += (1 - ADAM_BETA1) * gradient
    second *= ADAM_BETA2
    second += (1 - ADAM_BETA2) * np.square(gradient)
    unbiased = second / (1 - ADAM_BETA2**number)
    values -= rate / (1 - ADAM_BETA1**number) * first / (np.sqrt(unbiased) + ADAM_EPSILON)
