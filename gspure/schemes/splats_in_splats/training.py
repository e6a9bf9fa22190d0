"""Training: both scenes learn together, then the opacity mapping and the hidden colours; publication."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from gspure.cameras import Camera
from gspure.model.gaussians import LEAST_OPACITY, logit, sigmoid
from gspure.opencl.storage import morton_order
from gspure.opencl.trainable import Parameters, TrainState, TwinModel
from gspure.progress import say
from gspure.public_model import Lesson, PublicModel
from gspure.schemes.hidden_weight import low_rows
from gspure.schemes.scheme import Run
from gspure.schemes.splats_in_splats import bits
from gspure.schemes.splats_in_splats.key import SplatsInSplatsKey
from gspure.schemes.splats_in_splats.opacity_mapping import fit
from gspure.schemes.splats_in_splats.refining import refined
from gspure.training.dataset import reduced
from gspure.training.densification import reset_opacities
from gspure.training.fast import schedule_of
from gspure.training.output import as_gaussians
from gspure.training.trainer import densified

OPACITY_THRESHOLD: Final = 0.25  # tau of the paper: the key holds the Gaussians whose opacity in the message is higher
REFINED: Final = 0.2  # iterations with the mapped opacities, as a share of those of the joint training; ours
HELD_EVERY: Final = 10  # interval of the resets that keep the message off low rows, in iterations; ours


class Training:
    """A run; iterating over it trains and yields the loss of each iteration.

    The rules are those of 3DGS, with two changes: growth follows the gradient of the summed losses, and a Gaussian is
    pruned only if it is transparent in both scenes, so that some can serve the message alone.
    """

    def __init__(self, run: Run, begin: Parameters) -> None:
        state = TrainState.fresh(begin)
        self.model = TwinModel((state, state), run.message_weight, run.device)
        self._run = run
        self._pair = run.pair
        self._schedule = schedule_of(run.schedule, run.iterations)
        self._views: list[Sequence[Camera]] = []  # of the scene and of the message, at the size of this iteration
        self._reduction = 0
        self._low = np.zeros(0, np.bool_)
        self._rng = np.random.default_rng(run.seed)

    def __iter__(self) -> Iterator[float]:
        iterations = range(1, self._schedule.iterations + 1)
        for iteration, batch in zip(iterations, self._pair.batches(self._rng), strict=False):
            for model in self.model.models:
                model.sh_degree_active = self._schedule.sh_degree(iteration)
            self._show(self._schedule.reduction(iteration))
            cameras = (self._views[0][batch[0]], self._views[1][batch[1]])
            yield self.model.step(cameras, batch, self._schedule.rates(iteration, self._pair.extent))
            if self._schedule.densifies(iteration):
                self._densify(iteration)
            if self._run.hardened:
                self._harden(iteration)

    def _show(self, reduction: int) -> None:
        """Put the photographs of both captures on the device, with their sides divided by `reduction`."""
        if reduction == self._reduction:
            return
        self._reduction = reduction
        scene = self._pair.scene
        message = self._pair.message
        scene_views, scene_images = reduced(scene.views, scene.images, reduction)
        message_views, message_images = reduced(message.views, message.images, reduction)
        self._views = [scene_views, message_views]
        self.model.set_targets(scene_images, message_images)

    def _harden(self, iteration: int) -> None:
        """Take the message off the rows that `plain_weight` removes.

        They are measured at every interval of the densification, and at the end. After the densification, their hidden
        opacities are reset so often that the message moves to rows that the scene needs.
        """
        measures = iteration % self._schedule.densify_every == 0 or iteration == self._schedule.iterations
        holds = iteration >= self._schedule.densify_until and iteration % HELD_EVERY == 0
        if not (measures or holds):
            return
        scene, message = self.model.states()
        if measures:
            public = PublicModel(as_gaussians(scene.parameters))
            self._low = low_rows(public, self._pair.scene.views, self._run.hardened, self._run.device)
        self.model.replace((scene, reset_opacities(message, self._low)))

    def _densify(self, iteration: int) -> None:
        scene, message = self.model.states()
        logits = np.maximum(scene.parameters.opacity_logits, message.parameters.opacity_logits)
        scene, message = densified(
            (scene, message),
            self.model.models[0].statistics(),
            self._schedule,
            iteration,
            extent=self._pair.extent,
            rng=self._rng,
            max_gaussians=self._run.most_rows,
            opacities=sigmoid(logits),
        )
        self.model.replace((scene, message))

    def published(self, shift: int) -> tuple[PublicModel, SplatsInSplatsKey]:
        """Return the public model, whose colours hide those of the message in their low bits, and its key."""
        scene, message = (state.parameters for state in self.model.states())
        message_opacities = sigmoid(message.opacity_logits)
        rows = np.flatnonzero(message_opacities > OPACITY_THRESHOLD)
        rows = rows[morton_order(message.means[rows])]
        scene_opacities = sigmoid(scene.opacity_logits)[rows]
        mapping = fit(scene_opacities, message_opacities[rows], np.random.default_rng(self._run.seed))
        mapped_logits = logit(mapping(scene_opacities), LEAST_OPACITY)
        extracted = replace(message.rows(rows), opacity_logits=mapped_logits)
        steps = round(REFINED * self._run.iterations)
        colours = message.sh_coeffs.copy()
        photographs = self._pair.message
        rng = np.random.default_rng(self._run.seed)
        lesson = Lesson(photographs.views, photographs.images, (), steps, rng, device=self._run.device)
        colours[rows] = refined(extracted, lesson).sh_coeffs
        public = as_gaussians(replace(scene, sh_coeffs=bits.embed(scene.sh_coeffs, colours, shift)))
        say(f"{len(rows)} of {len(scene)} Gaussians have an opacity above {OPACITY_THRESHOLD} in the message")
        return PublicModel(public), SplatsInSplatsKey(message.means[rows], mapping, shift, as_gaussians(message))
