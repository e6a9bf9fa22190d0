"""Gaussians with trained features: 3DGS's parameters and optimizer, with features instead of colours."""

from collections.abc import Callable
from typing import Final

import numpy as np

from gspure.cameras.camera import Camera
from gspure.files import Bools, Float32
from gspure.model import Gaussians
from gspure.model.activations import sigmoid
from gspure.opencl.adam import LearningRates
from gspure.opencl.device import Device
from gspure.opencl.trainable import Parameters, Statistics, TrainState
from gspure.renderer import Gradients, Renderer
from gspure.schemes.gs_hider.layout import CHANNELS, COLUMNS
from gspure.training.adam import adam_step

FEATURES_RATE: Final = 2.5e-3  # the authors': that of 3DGS's base colours


class Field:
    """The state of a run, in memory. Each step uploads it again, which costs little beside the decoders.

    The colours of `start` are ignored: features start at 0, that is at 1/2 after the sigmoid.
    """

    def __init__(self, start: Parameters, device: Device) -> None:
        features = np.zeros((len(start), CHANNELS), np.float32)
        geometry = (start.means, start.quats, start.log_scales, start.opacity_logits)
        self._device = device
        self._steps = 0
        self._gradients: list[Parameters] = []
        self.replace(TrainState.fresh(Parameters(*geometry, features)))

    def __len__(self) -> int:
        return len(self.state.parameters)

    def replace(self, state: TrainState) -> None:
        """Continue from `state`, whose ``sh_coeffs`` [K,16] are features; the statistics are reset."""
        self.state = state
        self._norms = np.zeros(len(self), np.float32)
        self._views = np.zeros(len(self), np.uint32)
        self._upload()

    @property
    def features(self) -> Float32:
        """Raw features [K,16], before the sigmoid."""
        return self.state.parameters.sh_coeffs

    def statistics(self) -> Statistics:
        """Return the statistics for densification. A view counts for the Gaussians that its loss depends on."""
        return Statistics(self._norms, self._views)

    def model(self) -> Gaussians:
        """Return the Gaussians as a table in the columns of their file."""
        p = self.state.parameters
        parts = (p.means, np.zeros_like(p.means), p.opacity_logits[:, None], p.log_scales, p.quats, self.features)
        rows = np.concatenate(parts, axis=1)
        return Gaussians(rows.view([(name, "<f4") for name in COLUMNS])[:, 0])

    def feature_map(self, camera: Camera, low: Bools | None = None) -> tuple[Float32, Callable[[Float32], Gradients]]:
        """Return a view's blended features [H,W,16] on black, and the function that pulls their gradient back.

        Rows where the mask `low` [K] is true are left out; their gradients are zero.
        """
        if low is None:
            return self._renderer.vjp(camera, sigmoid(self.features))
        feature_map, pull_back = Renderer(self.model()[~low], self._device).vjp(camera, sigmoid(self.features[~low]))

        def spread(gradient: Float32) -> Gradients:
            of_kept = vars(pull_back(gradient))
            of_all = {name: np.zeros((len(low), *part.shape[1:]), np.float32) for name, part in of_kept.items()}
            for name, part in of_kept.items():
                of_all[name][~low] = part
            return Gradients(**of_all)

        return feature_map, spread

    def accumulate(self, camera: Camera, gradients: Gradients) -> None:
        """Add a view's gradients to those of the next step, and to the statistics."""
        half_size = np.array([camera.width / 2, camera.height / 2], np.float32)
        norms = np.linalg.norm(gradients.means2d * half_size, axis=1)
        self._norms += norms
        self._views += norms > 0
        self._gradients.append(self._raw(gradients))

    def step(self, rates: LearningRates) -> None:
        """Take an optimizer step along the sum of the accumulated gradients."""
        self._steps += 1
        rates_by_group = (rates.means, rates.quats, rates.scales, rates.opacities, FEATURES_RATE)
        gradients = [np.sum(parts, axis=0) for parts in zip(*(vars(g).values() for g in self._gradients), strict=True)]
        states = [vars(part).values() for part in vars(self.state).values()]
        for values, first, second, gradient, rate in zip(*states, gradients, rates_by_group, strict=True):
            adam_step(values, first, second, gradient, rate, self._steps)
        self._gradients.clear()
        self._upload()

    def _upload(self) -> None:
        self._renderer = Renderer(self.model(), self._device)

    def _raw(self, gradients: Gradients) -> Parameters:
        """Return the gradients of raw parameters, given those of activated ones."""
        p = self.state.parameters
        opacities, features = sigmoid(p.opacity_logits), sigmoid(self.features)
        return Parameters(
            gradients.means,
            gradients.quats,
            gradients.scales * np.exp(p.log_scales),
            gradients.opacities * opacities * (1 - opacities),
            gradients.channels * features * (1 - features),
        )
