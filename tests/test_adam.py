"""Adam over parameters on the device, against float64."""

from dataclasses import astuple

import numpy as np
import pytest

from gspure.constants import GEOMETRY_ATTRIBUTES
from gspure.opencl.adam import Adam, LearningRates, Moments, adam_step
from gspure.opencl.engine import Engine
from gspure.opencl.gradients import DeviceGradients, by_row
from gspure.opencl.storage import Storage, upload_attributes

RATES = LearningRates(means=1e-3, quats=2e-3, scales=5e-3, opacities=0.05, sh_dc=2.5e-3, sh_rest=1e-4)
OF_GEOMETRY = np.repeat(astuple(RATES)[:4], [3, 4, 3, 1])
OF_CHANNELS = np.repeat(astuple(RATES)[4:], [3, 9])


def activated(geometry):
    """(what the renderer takes, its derivative by what is stored) of raw geometry [K,11]."""
    values, slopes = geometry.astype(np.float64), np.ones(geometry.shape)
    values[:, 7:10] = slopes[:, 7:10] = np.exp(values[:, 7:10])
    values[:, 10] = 1 / (1 + np.exp(-values[:, 10]))
    slopes[:, 10] = values[:, 10] * (1 - values[:, 10])
    return values, slopes


class OnDevice:
    """Parameters of `count` Gaussians in a storage order of no particular kind, stepped on a device."""

    def __init__(self, device, style, geometry, channels):
        self.engine = Engine(device.cl_device, style)
        self.count, self.attributes = len(geometry), channels.shape[1]
        order = np.random.default_rng(9).permutation(self.count).astype(np.uint32)
        self.storage = Storage.along(self.engine, order, self.uploaded(np.zeros_like(geometry), order))
        self.geometry, self.channels = (
            Moments(self.uploaded(part), *(self.uploaded(np.zeros_like(part)) for _ in range(2)))
            for part in (geometry, channels)
        )
        self.adam = Adam(self.engine, self.count, self.geometry, self.channels, self.attributes, self.storage.geometry)

    def uploaded(self, rows, order=None):
        order = self.storage.order if order is None else order
        return upload_attributes(self.engine, order, rows.shape[1], rows.__getitem__)

    def step(self, number, geometry_gradients, channel_gradients):
        gradients = DeviceGradients(*map(self.uploaded, (geometry_gradients, channel_gradients)), None)
        self.adam.step(number, RATES, gradients)

    def rows(self, buffer, attributes=GEOMETRY_ATTRIBUTES):
        return by_row(self.engine, self.storage, buffer, attributes)


def parameters(count, attributes=12, seed=0):
    rng = np.random.default_rng(seed)
    geometry = rng.normal(0, 1.5, (count, GEOMETRY_ATTRIBUTES)).astype(np.float32)
    return geometry, rng.normal(size=(count, attributes)).astype(np.float32)


def random_gradients(shape, seed):
    """Of all sizes from 1e-12 to 1e4; a third are exactly zero, as those of what is not seen."""
    rng = np.random.default_rng(seed)
    gradients = rng.normal(size=shape) * 10 ** rng.uniform(-12, 4, shape)
    return np.where(rng.random(shape) < 1 / 3, 0, gradients).astype(np.float32)


@pytest.mark.parametrize("count", [1, 16, 17, 257])
@pytest.mark.parametrize("first_step", [1, 5000])
def test_steps_agree_with_the_reference(device, style, count, first_step):
    """Group by group, several in a row, near the start, where the corrections matter, and far from it."""
    geometry, channels = parameters(count)
    model = OnDevice(device, style, geometry, channels)
    parts = [(geometry, model.geometry, OF_GEOMETRY), (channels, model.channels, OF_CHANNELS)]
    states = [(raw.astype(np.float64), np.zeros(raw.shape), np.zeros(raw.shape)) for raw, _, _ in parts]
    largest = [np.zeros(raw.shape) for raw, _, _ in parts]
    for number in range(first_step, first_step + 4):
        gradients = [random_gradients(raw.shape, number + i) for i, (raw, _, _) in enumerate(parts)]
        model.step(number, *gradients)
        gradients[0] = gradients[0] * activated(states[0][0])[1]
        for state, gradient, (_, _, rate) in zip(states, gradients, parts, strict=True):
            adam_step(*state, gradient.astype(np.float64), rate, number)
        largest = [np.maximum(most, np.abs(gradient)) for most, gradient in zip(largest, gradients, strict=True)]
    for (_, buffers, rate), state, most in zip(parts, states, largest, strict=True):
        found = (model.rows(buffer, most.shape[1]) for buffer in (buffers.raw, buffers.first, buffers.second))
        errors = [np.abs(part - true) for part, true in zip(found, state, strict=True)]
        assert (errors[0] <= 5e-5 * rate + 3e-7 * np.abs(state[0])).all()
        assert (errors[1] <= 1e-6 * most).all()
        assert (errors[2] <= 1e-8 * most**2 + 1e-37).all()
    np.testing.assert_allclose(model.rows(model.storage.geometry), activated(states[0][0])[0], rtol=1e-5)
