"""Training: Gaussians with features and both decoders learn together (GS-Hider, section 3.3)."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Final

import numpy as np

from gspure.cameras.camera import Camera
from gspure.files import Bools, Float32
from gspure.model import Gaussians
from gspure.model.activations import sigmoid
from gspure.opencl.adam import LearningRates, adam_step
from gspure.opencl.device import Device
from gspure.opencl.losses import Photographs
from gspure.opencl.trainable import Parameters, Statistics, TrainState
from gspure.public_model import RenderView
from gspure.renderer import Gradients, Renderer
from gspure.schemes.gs_hider.decoder import Decoder, decoded, differentiated, untrained
from gspure.schemes.gs_hider.files import CHANNELS, COLUMNS
from gspure.schemes.gs_hider.model import FeatureModel
from gspure.schemes.hidden_weight import Hardening
from gspure.schemes.pair import Capture
from gspure.schemes.scheme import Run
from gspure.training.pytorch import single_threaded, torch
from gspure.training.schedule import Schedule
from gspure.training.trainer import densified

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
        self._renderer = Renderer(self.model(), self._device)

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
