"""Joint training: one set of Gaussians, with one opacity and colour for the scene and another for the message."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from gspure.model.activations import sigmoid
from gspure.opencl.adam import LearningRates
from gspure.opencl.device import Device
from gspure.opencl.trainable import Parameters, States, TrainableModel, TrainState, TwinModel
from gspure.public_model import PublicModel
from gspure.schemes.hidden_weight import low_rows
from gspure.schemes.pair import Capture
from gspure.schemes.scheme import Run
from gspure.training.densification import grow, plan, reset_opacities
from gspure.training.output import as_gaussians
from gspure.training.schedule import SH_DC_RATE, SH_REST_RATE, Schedule, shuffled

REFINING: Final = LearningRates(0.0, 0.0, 0.0, 0.0, SH_DC_RATE, SH_REST_RATE)  # rates of `refine`: colours only
HELD_EVERY: Final = 10  # interval of the resets that keep the message off low rows, in iterations; ours


class TwinTrainer:
    """A run; iterating over it trains and yields the loss of each iteration.

    The rules are those of 3DGS, with three changes: growth follows the gradient of the summed losses; a Gaussian is
    pruned only if it is transparent in both scenes, so that some can serve the message alone; opacities of both are
    reset.
    """

    def __init__(self, run: Run, begin: Parameters) -> None:
        state = TrainState.fresh(begin)
        self.model = TwinModel((state, state), run.message_weight, run.device)
        self.model.set_targets(run.pair.scene.images, run.pair.message.images)
        self._run = run
        self._pair = run.pair
        self._schedule = Schedule.scaled(run.iterations)
        self._low = np.zeros(0, np.bool_)
        self._rng = np.random.default_rng(run.seed)

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
            if self._run.hardened:
                self._harden(iteration)

    def _harden(self, iteration: int) -> None:
        """Take the message off the rows that `plain_weight` removes from the public model, and keep it off them.

        They are measured at every interval of the densification. Once it has ended, hidden opacities that grow again
        are reset so often that the message moves to rows that the scene needs.
        """
        measures = iteration % self._schedule.densify_every == 0 or iteration == self._schedule.iterations
        if not (measures or (iteration >= self._schedule.densify_until and iteration % HELD_EVERY == 0)):
            return
        shown, hidden = self.model.states()
        if measures:
            public = PublicModel(as_gaussians(shown.parameters))
            self._low = low_rows(public, self._pair.scene.views, self._run.hardened, self._run.device)
        self.model.replace((shown, reset_opacities(hidden, self._low)))

    def _grown(self, iteration: int) -> States:
        first, second = self.model.states()
        growth = plan(
            first.parameters,
            self.model.statistics(),
            sigmoid(np.maximum(first.parameters.opacity_logits, second.parameters.opacity_logits)),
            extent=self._pair.extent,
            prune_big=self._schedule.prunes_big(iteration),
            rng=self._rng,
            max_gaussians=self._run.most_rows,
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
