"""Adam over a model's parameters on the device (adam.cl)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from gspure.constants import ADAM_BETA1, ADAM_BETA2
from gspure.opencl.engine import LANES, Engine
from gspure.opencl.gradients import DeviceGradients


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


def activate(engine: Engine, count: int, raw: cl.Buffer, activated: cl.Buffer) -> None:
    """Write the activated geometry, as the renderer takes it, of the raw one."""
    kernel = _kernel(engine, "activate_geometry", 0)
    engine.run(kernel, -(-count // LANES[engine.style]), np.uint32(count), raw, activated)


def adam_step(
    engine: Engine,
    count: int,
    step: int,
    rates: LearningRates,
    gradients: DeviceGradients,
    geometry: Moments,
    activated: cl.Buffer,
    channels: Moments,
    channel_attributes: int,
) -> None:
    """Take step number `step` (from 1 on); `activated` geometry follows the raw one."""
    if not count:
        return
    items = -(-count // LANES[engine.style])
    corrections = (np.float32(1 / (1 - ADAM_BETA1**step)), np.float32(1 / (1 - ADAM_BETA2**step)))
    per_attribute = [rates.means] * 3 + [rates.quats] * 4 + [rates.scales] * 3 + [rates.opacities]
    engine.run(
        _kernel(engine, "adam_geometry", channel_attributes),
        items,
        *(np.uint32(count), engine.upload("rates", np.array(per_attribute, np.float32)), *corrections),
        *(gradients.geometry, geometry.raw, geometry.first, geometry.second, activated),
    )
    engine.run(
        _kernel(engine, "adam_channels", channel_attributes),
        items,
        *(np.uint32(count), np.float32(rates.sh_dc), np.float32(rates.sh_rest), *corrections),
        *(gradients.channels, channels.raw, channels.first, channels.second),
    )


def _kernel(engine: Engine, name: str, channel_attributes: int) -> cl.Kernel:
    return engine.kernel(name, "vector", "layout", "adam", CHANNEL_ATTRIBUTES=channel_attributes, RAY=0, CHANNELS=0)
