"""The training loop: each iteration renders a view of the scene and one of the message, from the same rows."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from gspure.cameras.camera import Camera
from gspure.files import Float32
from gspure.model.activations import sigmoid
from gspure.opencl.adam import adam_step
from gspure.opencl.device import Device
from gspure.opencl.losses import Photographs
from gspure.opencl.trainable import Parameters, Statistics, TrainState
from gspure.schemes.keyss.network import Network, added, fresh, parameters_of, random_key, rows_of
from gspure.schemes.scheme import Run
from gspure.schemes.secure_gs.growing import screen_norms
from gspure.training.pytorch import torch
from gspure.training.schedule import Schedule
from gspure.training.torch_bridge import TorchRenderer
from gspure.training.trainer import densified

WRONG_WEIGHT: Final = 0.02  # of the loss with a wrong key: the authors' 0.01 / 0.5, since the scene's weight is 1

_SIZES: Final = (3, 4, 3, 1, 3, 45)
"""Lengths of the parts of a row: position, quaternion, log-scale, opacity logit, base colour, higher harmonics."""


class Branch:
    """Views with their photographs, drawn from rows in tensors."""

    def __init__(self, views: Sequence[Camera], images: Sequence[Float32], device: Device | None) -> None:
        self.views = views
        self._photographs = Photographs(images, device)
        self._render = TorchRenderer(device)

    def differentiate(self, rows: torch.Tensor, view: int, weight: float) -> tuple[float, Float32]:
        """Add the gradients of a view's weighted loss; return the loss, and the norms [K] of projected centres."""
        means, quats, log_scales, logits, *colours = rows.split(_SIZES, dim=1)
        means.retain_grad()
        geometry = (means, quats, log_scales.exp(), logits[:, 0].sigmoid())
        camera, sh_coeffs = self.views[view], torch.cat(colours, dim=1).reshape(len(rows), -1, 3)
        image = self._render(camera, *geometry, sh_coeffs=sh_coeffs)
        loss, gradient = self._photographs.compare(view, image.detach().numpy())
        image.backward(weight * torch.from_numpy(gradient))
        return weight * loss, screen_norms(camera, means.detach().numpy(), means.grad.numpy())


class Learner:
    """A network in training, with the authors' optimizer."""

    def __init__(self, network: Network) -> None:
        self._layers = {name: torch.from_numpy(array.copy()).requires_grad_() for name, array in network.items()}
        self._optimizer = torch.optim.AdamW(self._layers.values())

    def added(self, rows: torch.Tensor, key: Float32) -> torch.Tensor:
        """Return the offsets from public rows to those of the message."""
        return added(torch, self._layers, torch.from_numpy(key), rows)

    def step(self, rate: float) -> None:
        """Take an optimizer step and clear the gradients."""
        self._optimizer.param_groups[0]["lr"] = rate
        self._optimizer.step()
        self._optimizer.zero_grad()

    def network(self) -> dict[str, Float32]:
        """Return a copy of the network."""
        return {name: layer.detach().numpy().copy() for name, layer in self._layers.items()}


class Training:
    """A run; iterating over it trains and yields the loss of each iteration.

    The same arguments give the same bits with one thread of PyTorch. The rules are those of 3DGS, with three changes:
    Gaussians grow by the gradients of scene and message; a Gaussian is pruned only if it is transparent in both; the
    message does not train public opacities, so Gaussians outside all views of the scene stay transparent after a reset,
    and show the message to nobody without the key. The network's learning rate falls from `network_rate` to zero.
    """

    def __init__(self, run: Run, begin: Parameters, network_rate: float) -> None:
        self.pair = run.pair
        self._rng = np.random.default_rng(run.seed)
        self.learner = Learner(fresh(self._rng))
        self.key = random_key(self._rng)  # not the generator's first numbers, which are a wrong key of the same seed
        self._scene, self._message = (
            Branch(capture.views, capture.images, run.device) for capture in (run.pair.scene, run.pair.message)
        )
        self._message_weight = run.message_weight
        self._network_rate = network_rate
        self._schedule = Schedule.scaled(run.iterations)
        self._most_rows = run.most_rows
        self._replace(TrainState.fresh(begin))

    def __iter__(self) -> Iterator[float]:
        batches = self.pair.batches(self._rng)
        for iteration in range(1, self._schedule.iterations + 1):
            yield self._step(iteration, *next(batches))
            if self._schedule.densifies(iteration):
                self._densify(iteration)

    def _step(self, iteration: int, scene_view: int, message_view: int) -> float:
        rows = torch.from_numpy(self.rows).requires_grad_()
        loss, norms = self._scene.differentiate(rows, scene_view, 1.0)
        if self._message_weight:
            geometry, logits, colours = rows.split((10, 1, 48), dim=1)
            public = torch.cat([geometry, logits.detach(), colours], dim=1)
            message = public + self.learner.added(public, self.key)
            message_loss, message_norms = self._message.differentiate(message, message_view, self._message_weight)
            wrong = WRONG_WEIGHT * self.learner.added(rows.detach(), random_key(self._rng)).abs().mean()
            wrong.backward()
            loss, norms = loss + message_loss + wrong.item(), norms + message_norms
            self.learner.step(self._network_rate * self._schedule.settling(iteration))
        self._norms += norms
        self._views += norms > 0
        rates = np.repeat(list(vars(self._schedule.rates(iteration, self.pair.extent)).values()), _SIZES)
        adam_step(self.rows, self._first, self._second, rows.grad.numpy(), rates.astype(np.float32), iteration)
        return loss

    def _densify(self, iteration: int) -> None:
        state = TrainState(*map(parameters_of, (self.rows, self._first, self._second)))
        logits = state.parameters.opacity_logits
        if self._message_weight:
            message = parameters_of(self.rows + added(np, self.learner.network(), self.key, self.rows))
            logits = np.maximum(logits, message.opacity_logits)
        after = densified(
            *(state, Statistics(self._norms, self._views), self._schedule, iteration),
            extent=self.pair.extent,
            rng=self._rng,
            max_gaussians=self._most_rows,
            opacities=sigmoid(logits),
        )
        self._replace(after)

    def _replace(self, state: TrainState) -> None:
        self.rows, self._first, self._second = map(rows_of, vars(state).values())
        self._norms, self._views = np.zeros(len(self.rows), np.float32), np.zeros(len(self.rows), np.uint32)
