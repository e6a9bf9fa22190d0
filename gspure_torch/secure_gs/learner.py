"""Anchors and networks in training: the loss of one view, its gradients, the optimizer."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Final

import numpy as np

from gspure.arrays import Float32, Indices
from gspure.cameras.camera import Camera
from gspure.constants import ADAM_EPSILON
from gspure.opencl.device import Device
from gspure.opencl.losses import Photographs
from gspure.public_model import Background
from gspure.renderer import BLACK
from gspure_torch.bridge import TorchRenderer
from gspure_torch.pytorch import on_device, on_host, torch
from gspure_torch.secure_gs.anchors import Anchors, Networks, Neural, neural
from gspure_torch.secure_gs.growing import joined

VOLUME_WEIGHT: Final = 0.01  # weight of the active Gaussians' mean volume in each branch's loss (Scaffold-GS)
LEARNED: Final = ("offsets", "features", "log_scalings")  # trained attributes of anchors; positions are fixed


class Learner:
    """Shared anchors, and each branch's networks and photographs, by training view; the first branch is the scene's."""

    def __init__(self, anchors: Anchors, branches: Sequence[Networks], device: Device) -> None:
        self._render = TorchRenderer(device)
        self._device = device
        self._photographs: list[Photographs] = []
        self._positions = on_device(anchors.positions)
        self._learned = {name: _leaf(getattr(anchors, name)) for name in LEARNED}
        self._branches = [_leaves(networks) for networks in branches]
        groups = [{"params": [tensor], "name": name} for name, tensor in self._learned.items()]
        for networks in self._branches:
            groups += [{"params": [*network.values()], "name": name} for name, network in networks.items()]
        self._optimizer = torch.optim.Adam(groups, eps=ADAM_EPSILON, fused=True)

    def show(self, photographs: Sequence[Sequence[Float32]]) -> None:
        """Let each branch learn from these photographs."""
        self._photographs = [Photographs(images, self._device) for images in photographs]

    @property
    def anchors(self) -> Anchors:
        """The current anchors, as arrays that share memory with the tensors."""
        return Anchors(on_host(self._positions), *map(on_host, self._learned.values()))

    def networks(self, branch: int) -> dict[str, dict[str, Float32]]:
        """Return a copy of a branch's networks."""
        return {
            name: {parameter: on_host(tensor).copy() for parameter, tensor in network.items()}
            for name, network in self._branches[branch].items()
        }

    def differentiate(
        self, branch: int, camera: Camera, rows: Indices, view: int, weight: float, background: Background = BLACK
    ) -> tuple[float, Neural, Float32]:
        """Add the gradients of a branch's weighted loss to those of all parameters.

        `rows` [V] are the visible anchors; `view` is the index of the camera and of its photograph. Return the weighted
        loss, the view's Gaussians as arrays, and the gradients [A,3] of the loss with respect to their centres.
        """
        anchors = Anchors(self._positions, **self._learned).at(on_device(rows))
        centre = on_device(camera.centre.astype(np.float32))
        gaussians = neural(torch, anchors, self._branches[branch], centre)
        gaussians.means.retain_grad()
        image = self._render(
            camera,
            gaussians.means,
            gaussians.quats,
            gaussians.scales,
            gaussians.opacities,
            features=gaussians.colors,
            background=background,
        )
        volume = gaussians.scales.prod(dim=1).sum() / max(len(gaussians.scales), 1)
        loss, gradient = self._photographs[branch].compare(view, on_host(image))
        gradients = [weight * on_device(gradient), torch.full_like(volume, weight * VOLUME_WEIGHT)]
        torch.autograd.backward([image, volume], gradients)
        arrays = {field.name: on_host(getattr(gaussians, field.name)) for field in fields(gaussians)}
        total = weight * (loss + VOLUME_WEIGHT * volume.item())
        return total, replace(gaussians, **arrays), on_host(gaussians.means.grad)

    def step(self, rates: dict[str, float]) -> None:
        """Take an optimizer step and clear the gradients."""
        for group in self._optimizer.param_groups:
            group["lr"] = rates[group["name"]]
        self._optimizer.step()
        self._optimizer.zero_grad()

    def replace_anchors(self, rows: Indices, new: Anchors) -> None:
        """Keep the anchors `rows` and append new ones, whose moments start at zero."""
        after = joined(self.anchors.at(rows), new)
        self._positions = on_device(after.positions)
        for group in self._optimizer.param_groups[: len(LEARNED)]:
            name = group["name"]
            (before,) = group["params"]
            leaf = _leaf(getattr(after, name))
            moments = self._optimizer.state.pop(before)
            zeros = leaf.new_zeros(len(new.positions), *leaf.shape[1:])
            for moment in ("exp_avg", "exp_avg_sq"):
                moments[moment] = torch.cat([moments[moment][on_device(rows)], zeros])
            self._optimizer.state[leaf] = moments
            group["params"] = [leaf]
            self._learned[name] = leaf


def _leaves(networks: Networks) -> dict[str, dict[str, torch.Tensor]]:
    """Return networks as tensors that learn."""
    return {
        name: {parameter: _leaf(array) for parameter, array in network.items()} for name, network in networks.items()
    }


def _leaf(array: Float32) -> torch.Tensor:
    return on_device(np.array(array, np.float32)).requires_grad_()
