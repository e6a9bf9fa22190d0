"""Training: Gaussians with features and both decoders learn together (GS-Hider, section 3.3)."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from gspure.arrays import Float32
from gspure.cameras.camera import Camera
from gspure.model import Gaussians
from gspure.model.gaussians import sigmoid
from gspure.opencl.losses import Photographs
from gspure.opencl.trainable import Parameters
from gspure.renderer import Renderer
from gspure.schemes.gs_hider.decoder import Decoder, differentiated, untrained
from gspure.schemes.gs_hider.model import CHANNELS, COLUMNS, FeatureModel
from gspure.schemes.hidden_weight import Hardening
from gspure.schemes.rows import ENDS, TrainedRows
from gspure.schemes.scheme import Run
from gspure.training.pytorch import single_threaded, torch

FEATURES_RATE: Final = 2.5e-3  # the authors': that of 3DGS's base colours
DECODER_RATE: Final = 1e-3  # the authors', constant over 50 000 iterations; Adam's other settings are its defaults

_ALL: Final = slice(None)


class Branch(NamedTuple):
    """A decoder of the shared feature map, with its views, their photographs, and the weight of its loss."""

    decoder: Decoder
    photographs: Photographs
    weight: float
    views: Sequence[Camera]


class Training:
    """A run; iterating over it trains and yields the loss of each iteration.

    The same pair and seed give the same bits on the same kind of machine, for any number of cores. The colours of the
    initial Gaussians, `begin`, are ignored: features start at 0, that is at 1/2 after the sigmoid. If it `falls`, the
    decoders' learning rate goes to zero once Gaussians no longer grow.
    """

    def __init__(self, run: Run, begin: Parameters, *, falls: bool = True) -> None:
        self._run = run
        self._falls = falls
        self._rng = np.random.default_rng(run.seed)
        self.rows = TrainedRows(replace(begin, sh_coeffs=np.zeros((len(begin), CHANNELS), np.float32)), run, self._rng)
        captures = (run.pair.scene, run.pair.message)[: 1 + bool(run.message_weight)]
        self.branches = [
            Branch(decoder, Photographs(capture.images, run.device), weight, capture.views)
            for decoder, capture, weight in zip(untrained(2, run.seed), captures, (1, run.message_weight), strict=False)
        ]
        self._optimizer = torch.optim.Adam([p for b in self.branches for p in b.decoder.parameters()], DECODER_RATE)
        self._hardening = Hardening(run, self.rows.schedule.densify_every)

    def __iter__(self) -> Iterator[float]:
        batches = self._run.pair.batches(self._rng)
        with single_threaded(), ThreadPoolExecutor(len(self.branches)) as threads:
            for iteration in range(1, self._run.iterations + 1):
                yield self._step(iteration, next(batches), threads)
                if self.rows.schedule.densifies(iteration):
                    self.rows.densify(iteration)
                self._hardening.follow(iteration, lambda: FeatureModel(self.model(), None))

    def model(self, kept: Any = _ALL) -> Gaussians:
        """Return the current Gaussians, or some of them, as a table in the columns of their file."""
        means, quats, log_scales, logits, features = np.split(self.rows.values[kept], ENDS, axis=1)
        rows = np.concatenate([means, np.zeros_like(means), logits, log_scales, quats, features], axis=1)
        return Gaussians(rows.view([(name, "<f4") for name in COLUMNS])[:, 0])

    def _step(self, iteration: int, batch: tuple[int, int], threads: ThreadPoolExecutor) -> float:
        tasks = list(zip(self.branches, batch, strict=False))
        low = self._hardening.left_out(iteration)
        shown = [tasks] if self._run.pair.shares_poses and low is None else [[task] for task in tasks]
        loss, gradient = 0.0, np.zeros_like(self.rows.values)
        for branches in shown:  # one pass over the Gaussians for all branches that look from the same pose
            branch, view = branches[0]
            kept = ~low if low is not None and branch is not self.branches[0] else _ALL
            feature_map, pull_back = self._feature_map(branch.views[view], kept)
            work = [threads.submit(differentiated, feature_map, view, *branch[:3]) for branch, view in branches]
            losses, gradients = zip(*(share.result() for share in work), strict=True)
            gradient[kept] += pull_back(np.add.reduce(gradients))
            loss += float(sum(losses))
        for group in self._optimizer.param_groups:
            group["lr"] = DECODER_RATE * (self.rows.schedule.settling(iteration) if self._falls else 1.0)
        self._optimizer.step()
        rates = self.rows.schedule.rates(iteration, self._run.pair.extent)
        by_group = (rates.means, rates.quats, rates.scales, rates.opacities, FEATURES_RATE)
        for start, end, rate in zip((0, *ENDS), (*ENDS, None), by_group, strict=True):
            self.rows.step(iteration, gradient, rate, slice(start, end))
        return loss

    def _feature_map(self, camera: Camera, kept: Any) -> tuple[Float32, Callable[[Float32], Float32]]:
        """Return blended features [H,W,16] of some rows on black, and what pulls their gradient back to these rows."""
        rows = self.rows.values[kept]
        opacities, features = sigmoid(rows[:, 10:11]), sigmoid(rows[:, 11:])
        feature_map, pull_back = Renderer(self.model(kept), self._run.device).vjp(camera, features)

        def pulled(of_map: Float32) -> Float32:
            """Return the gradients of raw rows, and count the view."""
            of = pull_back(of_map)
            norms = np.zeros(len(self.rows), np.float32)
            half_size = np.array([camera.width / 2, camera.height / 2], np.float32)
            norms[kept] = np.linalg.norm(of.means2d * half_size, axis=1)
            self.rows.count_view(norms)
            of_opacities = of.opacities[:, None] * opacities * (1 - opacities)
            of_features = of.channels * features * (1 - features)
            parts = (of.means, of.quats, of.scales * np.exp(rows[:, 7:10]), of_opacities, of_features)
            return np.concatenate(parts, axis=1)

        return feature_map, pulled
