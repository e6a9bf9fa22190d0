"""Training: Gaussians with features and both decoders learn together (GS-Hider, section 3.3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from gspure.arrays import Float32
from gspure.cameras.camera import Camera
from gspure.model import Gaussians
from gspure.model.gaussians import sigmoid
from gspure.opencl.device import Device
from gspure.opencl.losses import Photographs
from gspure.opencl.trainable import Parameters
from gspure.renderer import Renderer
from gspure.schemes.hidden_weight import Hardening
from gspure.schemes.pair import Capture
from gspure.schemes.scheme import Run
from gspure.training.dataset import reduced
from gspure_torch.gs_hider.decoder import Decoder, differentiated, untrained
from gspure_torch.gs_hider.model import CHANNELS, COLUMNS, FeatureModel
from gspure_torch.pytorch import single_threaded, torch
from gspure_torch.rows import ENDS, TrainedRows

DECODER_RATE: Final = 1e-3  # the authors', constant over 50 000 iterations; Adam's other settings are its defaults

_ALL: Final = slice(None)


class Branch(NamedTuple):
    """A decoder of the shared feature map, with its views, their photographs, and the weight of its loss."""

    decoder: Decoder
    photographs: Photographs
    weight: float
    views: Sequence[Camera]

    @staticmethod
    def of_capture(decoder: Decoder, capture: Capture, weight: float, device: Device, reduction: int = 1) -> Branch:
        """Return the branch of a decoder that learns from a capture, its sides divided by `reduction`."""
        views, images = reduced(capture.views, capture.images, reduction)
        return Branch(decoder, Photographs(images, device), weight, views)


class Training:
    """A run; iterating over it trains and yields the loss of each iteration.

    The same pair and seed give the same bits on the same kind of machine, for any number of cores. The colours of the
    initial Gaussians, `begin`, are ignored: features start at 0, that is at 1/2 after the sigmoid. With `falls`, the
    learning rate of the decoders falls to zero after the last densification.
    """

    def __init__(self, run: Run, begin: Parameters, *, falls: bool = True) -> None:
        self._run = run
        self._falls = falls
        self._rng = np.random.default_rng(run.seed)
        self.rows = TrainedRows(replace(begin, sh_coeffs=np.zeros((len(begin), CHANNELS), np.float32)), run, self._rng)
        scene_decoder, message_decoder = untrained(2, run.seed)
        self.branches = [Branch.of_capture(scene_decoder, run.pair.scene, 1.0, run.device)]
        if run.message_weight:
            message = Branch.of_capture(message_decoder, run.pair.message, run.message_weight, run.device)
            self.branches.append(message)
        weights = [tensor for branch in self.branches for tensor in branch.decoder.parameters()]
        self._reduction = 1  # of the branches' photographs
        self._optimizer = torch.optim.Adam(weights, DECODER_RATE)
        self._hardening = Hardening(run, self.rows.schedule.densify_every)

    def __iter__(self) -> Iterator[float]:
        batches = self._run.pair.batches(self._rng)
        with single_threaded(), ThreadPoolExecutor(len(self.branches)) as threads:
            for iteration in range(1, self._run.iterations + 1):
                self._show(self.rows.schedule.reduction(iteration))
                yield self._step(iteration, next(batches), threads)
                if self.rows.schedule.densifies(iteration):
                    self.rows.densify(iteration)
                self._hardening.follow(iteration, lambda: FeatureModel(self.model(), None))

    def _show(self, reduction: int) -> None:
        """Let the branches learn from photographs whose sides are divided by `reduction`."""
        if reduction == self._reduction:
            return
        self._reduction = reduction
        captures = (self._run.pair.scene, self._run.pair.message)
        self.branches = [
            Branch.of_capture(branch.decoder, capture, branch.weight, self._run.device, reduction)
            for branch, capture in zip(self.branches, captures, strict=False)
        ]

    def model(self, kept: Any = _ALL) -> Gaussians:
        """Return the current Gaussians, or the rows `kept` of them, as a table with the columns of their file."""
        means, quats, log_scales, logits, features = np.split(self.rows.values[kept], ENDS, axis=1)
        rows = np.concatenate([means, np.zeros_like(means), logits, log_scales, quats, features], axis=1)
        return Gaussians(rows.view([(name, "<f4") for name in COLUMNS])[:, 0])

    def _step(self, iteration: int, batch: tuple[int, int], threads: ThreadPoolExecutor) -> float:
        tasks = list(zip(self.branches, batch, strict=False))
        low = self._hardening.left_out(iteration)
        together = self._run.pair.shares_poses and low is None
        tasks_by_pass = [tasks] if together else [[task] for task in tasks]
        loss = 0.0
        gradient = np.zeros_like(self.rows.values)
        for branches in tasks_by_pass:  # one pass over the Gaussians for all branches that look from the same pose
            first, view = branches[0]
            left_out = None if first is self.branches[0] else low
            kept = _ALL if left_out is None else ~left_out
            feature_map, pull_back = self._feature_map(first.views[view], kept)
            jobs = [
                threads.submit(differentiated, feature_map, view, branch.decoder, branch.photographs, branch.weight)
                for branch, view in branches
            ]
            losses, gradients = zip(*(job.result() for job in jobs), strict=True)
            gradient[kept] += pull_back(np.add.reduce(gradients))
            loss += float(sum(losses))
        factor = self.rows.schedule.settling(iteration) if self._falls else 1.0
        for group in self._optimizer.param_groups:
            group["lr"] = DECODER_RATE * factor
        self._optimizer.step()
        rates = self.rows.schedule.rates(iteration, self._run.pair.extent)
        columns = [slice(start, end) for start, end in pairwise((0, *ENDS, None))]
        by_columns = (rates.means, rates.quats, rates.scales, rates.opacities, rates.sh_dc)
        for part, rate in zip(columns, by_columns, strict=True):
            self.rows.step(iteration, gradient, rate, part)
        return loss

    def _feature_map(self, camera: Camera, kept: Any) -> tuple[Float32, Callable[[Float32], Float32]]:
        """Return the blended features [H,W,16] of the rows `kept`, on black, and the function that differentiates them.

        The function returns the gradient of these rows for that of the features, and counts the view.
        """
        rows = self.rows.values[kept]
        opacities = sigmoid(rows[:, 10:11])
        features = sigmoid(rows[:, 11:])
        feature_map, pull_back = Renderer(self.model(kept), self._run.device).vjp(camera, features)

        def pull_back_to_rows(map_gradient: Float32) -> Float32:
            gradients = pull_back(map_gradient)
            norms = np.zeros(len(self.rows), np.float32)
            half_size = np.array([camera.width / 2, camera.height / 2], np.float32)
            norms[kept] = np.linalg.norm(gradients.means2d * half_size, axis=1)
            self.rows.count_view(norms)
            by_columns = (
                gradients.means,
                gradients.quats,
                gradients.scales * np.exp(rows[:, 7:10]),
                gradients.opacities[:, None] * opacities * (1 - opacities),
                gradients.channels * features * (1 - features),
            )
            return np.concatenate(by_columns, axis=1)

        return feature_map, pull_back_to_rows
