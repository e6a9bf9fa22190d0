"""Joint training: one set of Gaussians, with one opacity and colour for the scene and another for the message."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.model.activations import sigmoid
from gspure.opencl.adam import LearningRates
from gspure.opencl.device import Device
from gspure.opencl.trainable import Parameters, TrainableModel, TrainState
from gspure.opencl.twins import States, TwinModel
from gspure.schemes.pair import Capture, Pair
from gspure.training.densification import grow, plan, reset_opacities
from gspure.training.schedule import SH_DC_RATE, SH_REST_RATE, Schedule, shuffled

Float32 = NDArray[np.float32]

REFINING: Final = LearningRates(0.0, 0.0, 0.0, 0.0, SH_DC_RATE, SH_REST_RATE)
"""Rates of `refine`: colours only."""


class TwinTrainer:
    """A run; iterating over it trains and yields the loss of each iteration.

    The rules are those of 3DGS, with three changes: growth follows the gradient of the summed losses; a Gaussian is
    pruned only if it is transparent in both scenes, so that some can serve the message alone; opacities of both are
    reset.

    Parameters
    ----------
    begin : Parameters
        The initial Gaussians of both scenes.
    message_weight : float
        Share of the message's loss; that of the scene is 1.

    """

    def __init__(
        self,
        pair: Pair,
        begin: Parameters,
        schedule: Schedule,
        *,
        message_weight: float,
        max_gaussians: int,
        seed: int,
        device: Device | None = None,
    ) -> None:
        state = TrainState.fresh(begin)
        self.model = TwinModel((state, state), message_weight, device)
        self.model.set_targets(pair.scene.images, pair.message.images)
        self._pair = pair
        self._schedule = schedule
        self._max_gaussians = max_gaussians
        self._rng = np.random.default_rng(seed)

    def __iter__(self) -> Iterator[float]:
        batches = self._pair.batches(self._rng)
        for iteration in range(1, self._schedule.iterations + 1):
            self.model.use_sh_degree(self._schedule.sh_degree(iteration))
            batch = next(batches)
            cameras = (self._pair.scene.views[batch[0]], self._pair.message.views[batch[1]])
            yield self.model.step(cameras, batch, self._schedule.rates(iteration, self._pair.extent))
            if self._schedule.densifies(iteration):
                first, second = self._grown(iteration)
                resets = self._schedule.resets_opacities(iteration)
                self.model.replace((reset_opacities(first), reset_opacities(second)) if resets else (first, second))

    def _grown(self, iteration: int) -> States:
        first, second = self.model.states()
        growth = plan(
            first.parameters,
            sigmoid(np.maximum(first.parameters.opacity_logits, second.parameters.opacity_logits)),
            self.model.statistics(),
            extent=self._pair.extent,
            prune_big=self._schedule.prunes_big(iteration),
            rng=self._rng,
            max_gaussians=self._max_gaussians,
        )
        return grow(first, growth), grow(second, growth)


def refine(parameters: Parameters, capture: Capture, steps: int, seed: int, device: Device | None) -> Parameters:
    """Return `parameters` with colours trained for their opacities; everything else is bit-identical."""
    model = TrainableModel(TrainState.fresh(parameters), device=device)
    model.set_targets(capture.images)
    order = shuffled(len(capture.views), np.random.default_rng(seed))
    for _ in range(steps):
        view = next(order)
        model.step(capture.views[view], view, REFINING)
    return replace(parameters, sh_coeffs=model.state().parameters.sh_coeffs)
