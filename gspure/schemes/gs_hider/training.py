"""The training loop: each iteration renders one view of the scene and of the message."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Final

import numpy as np

from gspure.files import Float32
from gspure.opencl.device import Device
from gspure.opencl.losses import Photographs
from gspure.opencl.trainable import Parameters
from gspure.public_model import RenderView
from gspure.schemes.gs_hider.decoder import Decoder, decoded, differentiated, untrained
from gspure.schemes.gs_hider.field import Field
from gspure.schemes.gs_hider.public_model import FeatureModel
from gspure.schemes.hidden_weight import Hardening
from gspure.schemes.pair import Capture
from gspure.schemes.scheme import Run
from gspure.training.pytorch import single_threaded, torch
from gspure.training.schedule import Schedule
from gspure.training.trainer import densified

DECODER_RATE: Final = 1e-3  # the authors', constant over 50 000 iterations; Adam's other settings are its defaults


class Training:
    """A run; iterating over it trains and yields the loss of each iteration.

    The same pair and seed give the same bits on the same kind of machine, for any number of cores. The colours of the
    initial Gaussians, `begin`, are ignored. If it `falls`, the decoders' learning rate goes to zero once Gaussians no
    longer grow.
    """

    def __init__(self, run: Run, begin: Parameters, *, falls: bool = True) -> None:
        scene, message = untrained(2, run.seed)
        self.pair = run.pair
        self.field = Field(begin, run.device)
        self.branches = [Branch(scene, run.pair.scene, 1.0, run.device)]
        if run.message_weight:
            self.branches.append(Branch(message, run.pair.message, run.message_weight, run.device))
        self._optimizer = torch.optim.Adam([p for b in self.branches for p in b.decoder.parameters()], DECODER_RATE)
        self._schedule = Schedule.scaled(run.iterations)
        self._falls = falls
        self._hardening = Hardening(run, self._schedule.densify_every)
        self._run = run
        self._rng = np.random.default_rng(run.seed)

    def __iter__(self) -> Iterator[float]:
        batches = self.pair.batches(self._rng)
        with single_threaded(), ThreadPoolExecutor(len(self.branches)) as threads:
            for iteration in range(1, self._schedule.iterations + 1):
                yield self._step(iteration, next(batches), threads)
                if self._schedule.densifies(iteration):
                    self._densify(iteration)
                self._hardening.follow(iteration, lambda: FeatureModel(self.field.model(), None))

    @property
    def views(self) -> list[RenderView]:
        """The renderer of each branch, for the current Gaussians."""
        return [decoded(lambda camera: self.field.feature_map(camera)[0], branch.decoder) for branch in self.branches]

    def _step(self, iteration: int, batch: tuple[int, int], threads: ThreadPoolExecutor) -> float:
        tasks = list(zip(self.branches, batch, strict=False))
        low = self._hardening.left_out(iteration)
        shown = [tasks] if self.pair.shares_poses and low is None else [[task] for task in tasks]
        loss = 0.0
        for branches in shown:  # one pass over the Gaussians for all branches that look from the same pose
            branch, view = branches[0]
            camera = branch.views[view]
            feature_map, pull_back = self.field.feature_map(camera, low if branch is not self.branches[0] else None)
            work = [threads.submit(branch.differentiate, feature_map, view) for branch, view in branches]
            losses, gradients = zip(*(share.result() for share in work), strict=True)
            self.field.accumulate(camera, pull_back(np.sum(gradients, axis=0)))
            loss += float(sum(losses))
        for group in self._optimizer.param_groups:
            group["lr"] = DECODER_RATE * (self._schedule.settling(iteration) if self._falls else 1.0)
        self._optimizer.step()
        self.field.step(self._schedule.rates(iteration, self.pair.extent))
        return loss

    def _densify(self, iteration: int) -> None:
        self.field.replace(
            densified(
                *(self.field.state, self.field.statistics(), self._schedule, iteration),
                extent=self.pair.extent,
                rng=self._rng,
                max_gaussians=self._run.most_rows,
            )
        )


class Branch:
    """A decoder of the shared feature map, with its views and photographs and the weight of its loss."""

    def __init__(self, decoder: Decoder, capture: Capture, weight: float, device: Device) -> None:
        self.decoder = decoder
        self.views = capture.views
        self._photographs = Photographs(capture.images, device)
        self._weight = weight

    def differentiate(self, feature_map: Float32, view: int) -> tuple[float, Float32]:
        """Return the loss of a view and its gradient of the feature map; the decoder stores its own gradients."""
        return differentiated(self.decoder, feature_map, self._photographs, view, self._weight)
