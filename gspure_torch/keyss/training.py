"""The training loop: each iteration renders a view of the scene and one of the message, from the same rows."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from gspure.arrays import Float32
from gspure.cameras.camera import Camera
from gspure.model.frames import canonical
from gspure.model.gaussians import sigmoid
from gspure.opencl.device import Device
from gspure.opencl.losses import Photographs
from gspure.opencl.trainable import Parameters
from gspure.schemes.scheme import Run
from gspure_torch.bridge import TorchRenderer
from gspure_torch.keyss.network import ROW, Network, added, fresh, random_key
from gspure_torch.pytorch import BFLOAT16, DEVICE, on_device, on_host, single_threaded, torch
from gspure_torch.rows import TrainedRows, screen_norms

WRONG_WEIGHT: Final = 0.02  # of the loss with a wrong key: the authors' 0.01 / 0.5, since the scene's weight is 1
WRONG_EVERY: Final = 16  # a step measures the wrong key's offsets of every 16th row; ours, for speed

_SIZES: Final = (3, 4, 3, 1, 3, 45)  # of a row's position, quaternion, log-scale, logit, base colour, higher harmonics


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
        camera = self.views[view]
        scales = log_scales.exp()
        opacities = logits[:, 0].sigmoid()
        sh_coeffs = torch.cat(colours, dim=1).reshape(len(rows), -1, 3)
        image = self._render(camera, means, quats, scales, opacities, sh_coeffs=sh_coeffs)
        loss, gradient = self._photographs.compare(view, on_host(image))
        image.backward(weight * on_device(gradient))
        return weight * loss, screen_norms(camera, on_host(means), on_host(means.grad))


class Learner:
    """A network in training, with the authors' optimizer."""

    def __init__(self, network: Network) -> None:
        self._layers = {name: on_device(array.copy()).requires_grad_() for name, array in network.items()}
        self._optimizer = torch.optim.AdamW(self._layers.values())

    def added(self, rows: torch.Tensor, key: Float32) -> torch.Tensor:
        """Return the offsets from public rows to those of the message, as `network.added` does."""
        layers = self._layers
        first = layers["weight_0"]
        bias = first[:, ROW:] @ on_device(key) + layers["bias_0"]
        values = torch.addmm(bias, rows, first[:, :ROW].T)
        for layer in (1, 2):
            values = torch.addmm(layers[f"bias_{layer}"], values.relu_(), layers[f"weight_{layer}"].T)
        return values

    def coarsely_added(self, rows: torch.Tensor, key: Float32) -> torch.Tensor:
        """Return the offsets for training, computed in bfloat16 if that is fast."""
        with torch.autocast(DEVICE.type, torch.bfloat16, enabled=BFLOAT16):
            return self.added(rows, key).float()

    def differentiate(
        self, branch: Branch, rows: torch.Tensor, key: Float32, view: int, weight: float
    ) -> tuple[float, Float32, torch.Tensor, torch.Tensor]:
        """Add the gradients of a view of the message, which shows V rows, to those of the network.

        Return the weighted loss, the norms [K] of the gradients of projected centres, the indices [V] of these rows,
        and the gradients [V,59] with respect to their public values.
        """
        with torch.no_grad():
            message = rows + self.coarsely_added(rows, key)
        loss, norms = branch.differentiate(message.requires_grad_(), view, weight)
        shown = on_device(np.flatnonzero(norms))
        public = rows.index_select(0, shown).requires_grad_()
        gradient = message.grad.index_select(0, shown)
        self.coarsely_added(public, key).backward(gradient)
        return loss, norms, shown, gradient + public.grad

    def step(self, rate: float) -> None:
        """Take an optimizer step and clear the gradients."""
        self._optimizer.param_groups[0]["lr"] = rate
        self._optimizer.step()
        self._optimizer.zero_grad()

    def network(self) -> dict[str, Float32]:
        """Return a copy of the network."""
        return {name: on_host(layer).copy() for name, layer in self._layers.items()}


class Training:
    """A run; iterating over it trains and yields the loss of each iteration.

    The same arguments give the same bits with one thread of PyTorch. The rules are those of 3DGS, with three changes:
    Gaussians grow by the gradients of scene and message; a Gaussian is pruned only if it is transparent in both; the
    message does not train public opacities. So Gaussians outside all views of the scene stay transparent after a reset,
    and do not show the message without the key. The network's learning rate falls from `network_rate` to zero. If the
    run `is_canonical`, every step ends in canonical frames; the moments of the optimizer do not follow.
    """

    def __init__(self, run: Run, begin: Parameters, network_rate: float, *, is_canonical: bool = False) -> None:
        self._run = run
        self._is_canonical = is_canonical
        self._network_rate = network_rate
        self._rng = np.random.default_rng(run.seed)
        self.learner = Learner(fresh(self._rng))
        self.key = random_key(self._rng)  # not the generator's first numbers, which are a wrong key of the same seed
        self._scene = Branch(run.pair.scene.views, run.pair.scene.images, run.device)
        self._message = Branch(run.pair.message.views, run.pair.message.images, run.device)
        self.rows = TrainedRows(begin, run, self._rng)

    def __iter__(self) -> Iterator[float]:
        batches = self._run.pair.batches(self._rng)
        with single_threaded():
            for iteration in range(1, self._run.iterations + 1):
                yield self._step(iteration, *next(batches))
                if self.rows.schedule.densifies(iteration):
                    self.rows.densify(iteration, self._opacities())

    def _step(self, iteration: int, scene_view: int, message_view: int) -> float:
        schedule = self.rows.schedule
        rows = on_device(self.rows.values).requires_grad_()
        loss, norms = self._scene.differentiate(rows, scene_view, 1.0)
        if self._run.message_weight:
            public = rows.detach()
            message_loss, message_norms, shown, gradient = self.learner.differentiate(
                self._message, public, self.key, message_view, self._run.message_weight
            )
            gradient[:, 10] = 0  # the message does not train public opacities
            rows.grad.index_add_(0, shown, gradient)
            sample = public[iteration % min(WRONG_EVERY, len(public)) :: WRONG_EVERY]
            wrong = WRONG_WEIGHT * self.learner.coarsely_added(sample, random_key(self._rng)).abs().mean()
            wrong.backward()
            loss = loss + message_loss + wrong.item()
            norms = norms + message_norms
            self.learner.step(self._network_rate * schedule.settling(iteration))
        self.rows.count_view(norms)
        rates = vars(schedule.rates(iteration, self._run.pair.extent))
        rate_by_column = np.repeat(list(rates.values()), _SIZES).astype(np.float32)
        self.rows.step(iteration, on_host(rows.grad), rate_by_column)
        if self._is_canonical:
            values = self.rows.values
            values[:, 3:7], values[:, 7:10] = canonical(values[:, 3:7], values[:, 7:10])
        return loss

    def _opacities(self) -> Float32:
        """Return the higher of the opacities that each row [K] has in scene and message."""
        logits = self.rows.values[:, 10]
        if self._run.message_weight:
            added_logits = added(self.learner.network(), self.key, self.rows.values)[:, 10]
            logits = np.maximum(logits, logits + added_logits)
        return sigmoid(logits)
