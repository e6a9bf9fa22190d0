"""Splats in Splats: a hidden scene in the low bits and the opacities of a vanilla model (arXiv 2412.03121).

Embedding trains both scenes, maps the opacities, hides the colours and publishes. The paper leaves some choices open.
Ours: the loss is L(scene) + message_weight L(message), both as in 3DGS; means, quaternions and scales are shared; after
the opacity mapping is fitted, the hidden colours are trained further with the mapped opacities, which extraction uses
instead of the trained ones.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Annotated, Final

import numpy as np

from gspure.model.activations import LEAST_OPACITY, logit, sigmoid
from gspure.opencl.adam import LearningRates
from gspure.opencl.device import Device, choose_device
from gspure.opencl.storage import morton_order
from gspure.opencl.trainable import Parameters, TrainableModel, TrainState, TwinModel
from gspure.progress import say
from gspure.public_model import PublicModel
from gspure.schemes.hidden_weight import low_rows
from gspure.schemes.pair import Capture, Pair
from gspure.schemes.scheme import ADAPTIVE, MESSAGE, Run, Scheme
from gspure.schemes.splats_in_splats import bits
from gspure.schemes.splats_in_splats.key import ORACLE, SplatsInSplatsKey
from gspure.schemes.splats_in_splats.opacity_mapping import fit
from gspure.settings import Amount, MaxGaussians, Range, Steps
from gspure.training.densification import reset_opacities
from gspure.training.output import as_gaussians
from gspure.training.schedule import SH_DC_RATE, SH_REST_RATE, Schedule, shuffled
from gspure.training.trainer import densified, watched

OPACITY_THRESHOLD: Final = 0.25  # tau of the paper: the key holds the Gaussians whose opacity in the message is higher
REFINED: Final = 0.2  # iterations with the mapped opacities, as a share of those of the joint training; ours
REFINING: Final = LearningRates(0.0, 0.0, 0.0, 0.0, SH_DC_RATE, SH_REST_RATE)  # rates of `refined`: colours only
HELD_EVERY: Final = 10  # interval of the resets that keep the message off low rows, in iterations; ours


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 3000,
    message_weight: Amount = 1.0,
    max_gaussians: MaxGaussians = 30_000,
    shift: Annotated[int, Range(*bits.SHIFT_RANGE)] = bits.SHIFT,
    hardened: Amount = 0.0,
) -> tuple[PublicModel, SplatsInSplatsKey | None]:
    """Hide the pair's message in its scene; a message weight of 0 gives the scene's clean model, and no key.

    The joint training takes `iterations` steps; `message_weight` is the share of the message's loss, that of the scene
    is 1; `shift` is k of `gspure.schemes.splats_in_splats.bits`; `hardened` keeps the message off the rows that
    ``plain_weight`` removes with this tau, 0 trains as in the paper.
    """
    begin = pair.initial_gaussians(max_gaussians, seed)
    device = device or choose_device()
    if not message_weight:
        return PublicModel(pair.scene.trained(begin, iterations, max_gaussians, seed, device)), None
    run = TwinTrainer(Run(pair, iterations, message_weight, max_gaussians, seed, device, hardened), begin)
    for _ in watched(run, iterations, lambda: f"{run.model.models[0].count} Gaussians"):
        pass
    shown, hidden = (state.parameters for state in run.model.states())
    return _published(pair, shown, hidden, shift, round(REFINED * iterations), seed, device)


def _published(
    pair: Pair, shown: Parameters, hidden: Parameters, shift: int, steps: int, seed: int, device: Device
) -> tuple[PublicModel, SplatsInSplatsKey]:
    """Return the public model and its key."""
    known = np.flatnonzero(sigmoid(hidden.opacity_logits) > OPACITY_THRESHOLD)
    known = known[morton_order(hidden.means[known])]
    opacities = sigmoid(shown.opacity_logits)[known]
    mapping = fit(opacities, sigmoid(hidden.opacity_logits)[known], np.random.default_rng(seed))
    extracted = replace(hidden.rows(known), opacity_logits=logit(mapping(opacities), LEAST_OPACITY))
    colours = hidden.sh_coeffs.copy()
    colours[known] = refined(extracted, pair.message, steps, seed, device).sh_coeffs
    public = as_gaussians(replace(shown, sh_coeffs=bits.embed(shown.sh_coeffs, colours, shift)))
    say(f"{len(known)} of {len(shown)} Gaussians have an opacity above {OPACITY_THRESHOLD} in the message")
    return PublicModel(public), SplatsInSplatsKey(hidden.means[known], mapping, shift, as_gaussians(hidden))


class TwinTrainer:
    """A run; iterating over it trains and yields the loss of each iteration.

    The rules are those of 3DGS, but growth follows the gradient of the summed losses, and a Gaussian is pruned only if
    it is transparent in both scenes, so that some can serve the message alone.
    """

    def __init__(self, run: Run, begin: Parameters) -> None:
        state = TrainState.fresh(begin)
        self.model = TwinModel((state, state), run.message_weight, run.device)
        self.model.set_targets(run.pair.scene.images, run.pair.message.images)
        self._run, self._pair = run, run.pair
        self._schedule = Schedule.scaled(run.iterations)
        self._low = np.zeros(0, np.bool_)
        self._rng = np.random.default_rng(run.seed)

    def __iter__(self) -> Iterator[float]:
        iterations = range(1, self._schedule.iterations + 1)
        for iteration, batch in zip(iterations, self._pair.batches(self._rng), strict=False):
            for model in self.model.models:
                model.sh_degree_active = self._schedule.sh_degree(iteration)
            cameras = (self._pair.scene.views[batch[0]], self._pair.message.views[batch[1]])
            yield self.model.step(cameras, batch, self._schedule.rates(iteration, self._pair.extent))
            if self._schedule.densifies(iteration):
                self._densify(iteration)
            if self._run.hardened:
                self._harden(iteration)

    def _harden(self, iteration: int) -> None:
        """Take the message off the rows that `plain_weight` removes, measured at every interval of the densification.

        After it, hidden opacities that grow again are reset so often that the message moves to rows the scene needs.
        """
        measures = iteration % self._schedule.densify_every == 0 or iteration == self._schedule.iterations
        if not (measures or (iteration >= self._schedule.densify_until and iteration % HELD_EVERY == 0)):
            return
        shown, hidden = self.model.states()
        if measures:
            public = PublicModel(as_gaussians(shown.parameters))
            self._low = low_rows(public, self._pair.scene.views, self._run.hardened, self._run.device)
        self.model.replace((shown, reset_opacities(hidden, self._low)))

    def _densify(self, iteration: int) -> None:
        states = self.model.states()
        logits = np.maximum(*(state.parameters.opacity_logits for state in states))
        first, second = densified(
            *(states, self.model.models[0].statistics(), self._schedule, iteration),
            extent=self._pair.extent,
            rng=self._rng,
            max_gaussians=self._run.most_rows,
            opacities=sigmoid(logits),
        )
        self.model.replace((first, second))


def refined(parameters: Parameters, capture: Capture, steps: int, seed: int, device: Device | None) -> Parameters:
    """Return `parameters` with colours trained for their opacities; everything else is bit-identical."""
    model = TrainableModel(TrainState.fresh(parameters), device=device)
    model.set_targets(capture.images)
    order = shuffled(len(capture.views), np.random.default_rng(seed))
    for _ in range(steps):
        view = next(order)
        model.step(capture.views[view], view, REFINING)
    return replace(parameters, sh_coeffs=model.state().parameters.sh_coeffs)


GEOMETRY = ("x", "y", "z", "scale_*", "rot_*")
READS = {MESSAGE: (*GEOMETRY, "f_dc_*", "f_rest_*", "opacity"), ADAPTIVE: GEOMETRY, ORACLE: GEOMETRY}

SCHEME = Scheme("splats_in_splats", embed, PublicModel.read, SplatsInSplatsKey.read, READS)

HARDENED = replace(SCHEME, name="splats_in_splats_hardened", embed=partial(embed, hardened=2.0))
