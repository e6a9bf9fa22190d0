"""Training: each iteration renders one view of the scene and of the message from the same anchors."""

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import Final

import numpy as np

from gspure.cameras.camera import Camera
from gspure.constants import ADAM_EPSILON
from gspure.errors import InputError
from gspure.files import Bools, Float32, Indices
from gspure.opencl.device import Device
from gspure.opencl.losses import Photographs
from gspure.schemes.hidden_weight import Hardening
from gspure.schemes.scheme import Run
from gspure.schemes.secure_gs.anchors import Anchors, Neural, neural, table_of, visible_rows
from gspure.schemes.secure_gs.growing import (
    GRADIENT_THRESHOLD,
    AnchorSchedule,
    Candidates,
    Statistics,
    grown,
    hidden_box,
    inside,
    joined,
    screen_norms,
)
from gspure.schemes.secure_gs.model import AnchorModel
from gspure.schemes.secure_gs.networks import Networks
from gspure.training.pytorch import torch
from gspure.training.torch_bridge import TorchRenderer

VOLUME_WEIGHT: Final = 0.01  # weight of the active Gaussians' mean volume in each branch's loss (Scaffold-GS)
LEARNED: Final = ("offsets", "features", "log_scalings")  # trained attributes of anchors; positions are fixed


class Learner:
    """Shared anchors, one set of networks per branch, and its photographs by training view.

    The scene's branch is first.
    """

    def __init__(
        self, anchors: Anchors, branches: Sequence[Networks], photographs: Sequence[Sequence[Float32]], device: Device
    ) -> None:
        self._render = TorchRenderer(device)
        self._photographs = [Photographs(images, device) for images in photographs]
        self._positions = torch.from_numpy(anchors.positions)
        self._learned = {name: _leaf(getattr(anchors, name)) for name in LEARNED}
        self._branches = [{n: {p: _leaf(a) for p, a in net.items()} for n, net in nets.items()} for nets in branches]
        groups = [{"params": [tensor], "name": name} for name, tensor in self._learned.items()]
        groups += [
            {"params": [p for nets in self._branches if name in nets for p in nets[name].values()], "name": name}
            for name in {name: None for nets in branches for name in nets}
        ]
        self._optimizer = torch.optim.Adam(groups, eps=ADAM_EPSILON, fused=True)

    @property
    def anchors(self) -> Anchors:
        """The current anchors, as arrays that share memory with the tensors."""
        return Anchors(self._positions.numpy(), *(tensor.detach().numpy() for tensor in self._learned.values()))

    def networks(self, branch: int) -> dict[str, dict[str, Float32]]:
        """Return a copy of a branch's networks."""
        return {n: {p: t.detach().numpy().copy() for p, t in net.items()} for n, net in self._branches[branch].items()}

    def differentiate(
        self,
        branch: int,
        camera: Camera,
        rows: Indices,
        view: int,
        weight: float,
        background: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> tuple[float, Neural, Float32]:
        """Add the gradients of a branch's loss, times its weight, to those of all parameters.

        `rows` [V] are the visible anchors; `view` is the index of the camera, which is that of its photograph. Return
        the weighted loss, the view's Gaussians as arrays, and the loss's gradients [A,3] with respect to their centres.
        """
        anchors = Anchors(self._positions, **self._learned).at(torch.from_numpy(rows))
        centre = torch.from_numpy(camera.centre.astype(np.float32))
        gaussians = neural(torch, anchors, self._branches[branch], centre)
        gaussians.means.retain_grad()
        geometry = (gaussians.means, gaussians.quats, gaussians.scales, gaussians.opacities)
        image = self._render(camera, *geometry, features=gaussians.colors, background=background)
        volume = gaussians.scales.prod(dim=1).sum() / max(len(gaussians.scales), 1)
        loss, gradient = self._photographs[branch].compare(view, image.detach().numpy())
        torch.autograd.backward(
            [image, volume], [weight * torch.from_numpy(gradient), torch.tensor(weight * VOLUME_WEIGHT)]
        )
        arrays = {field.name: getattr(gaussians, field.name).detach().numpy() for field in fields(gaussians)}
        total = weight * (loss + VOLUME_WEIGHT * volume.item())
        return total, replace(gaussians, **arrays), gaussians.means.grad.numpy()

    def step(self, rates: dict[str, float]) -> None:
        """Take an optimizer step and clear the gradients."""
        for group in self._optimizer.param_groups:
            group["lr"] = rates[group["name"]]
        self._optimizer.step()
        self._optimizer.zero_grad()

    def replace_anchors(self, rows: Indices, new: Anchors) -> None:
        """Keep the anchors `rows` and append new ones, whose moments start at zero."""
        after = joined(self.anchors.at(rows), new)
        self._positions = torch.from_numpy(after.positions)
        for group in self._optimizer.param_groups[: len(LEARNED)]:
            (before,), name = group["params"], group["name"]
            leaf = _leaf(getattr(after, name))
            moments = self._optimizer.state.pop(before)
            zeros = torch.zeros(len(new.positions), *leaf.shape[1:])
            for moment in ("exp_avg", "exp_avg_sq"):
                moments[moment] = torch.cat([moments[moment][torch.from_numpy(rows)], zeros])
            self._optimizer.state[leaf] = moments
            group["params"] = [leaf]
            self._learned[name] = leaf


def _leaf(array: Float32) -> torch.Tensor:
    return torch.from_numpy(np.array(array, np.float32)).requires_grad_()


VISIBLE_SHARE: Final = 0.8
"""Least share of the views between two adjustments in which an anchor must be visible to be pruned (Scaffold-GS)."""

OPACITY_MIN: Final = 0.005  # anchors with a lower sum of opacities, averaged over the views, are pruned (Scaffold-GS)


class Training:
    """A run; iterating over it trains and yields the loss of each iteration.

    The same arguments give the same bits with one thread of PyTorch. `voxel` is the side of the smallest cells, in
    world units; `branches` are the networks of the scene, and of the message unless a clean model is trained;
    `density` is r_down of RDO, 1 without it.
    """

    def __init__(self, run: Run, anchors: Anchors, voxel: float, branches: Sequence[Networks], density: float) -> None:
        self.pair = run.pair
        self._captures = [run.pair.scene, run.pair.message][: len(branches)]
        self.learner = Learner(anchors, branches, [c.images for c in self._captures], run.device)
        self.boxed = 0.0
        self._voxel = voxel
        self._weights = (1.0, run.message_weight)
        self._density = density
        self._most_rows = run.most_rows
        self._schedule = AnchorSchedule.scaled(run.iterations)
        self._hardening = Hardening(run, self._schedule.adjust_every)
        self._statistics = [Statistics(len(anchors.positions), anchors.k) for _ in branches]
        self._rng = np.random.default_rng(run.seed)

    def public(self) -> AnchorModel:
        """Return the current public model."""
        return AnchorModel(table_of(self.learner.anchors), self.learner.networks(0))

    @property
    def hides(self) -> bool:
        """Whether there is a hidden branch."""
        return len(self._statistics) > 1

    def __iter__(self) -> Iterator[float]:
        batches = self.pair.batches(self._rng)
        for iteration in range(1, self._schedule.iterations + 1):
            yield self._iterate(iteration, next(batches))
            self._hardening.follow(iteration, self.public)

    def _iterate(self, iteration: int, batch: tuple[int, int]) -> float:
        anchors, low = self.learner.anchors, self._hardening.left_out(iteration)
        upright = np.broadcast_to(np.array([1, 0, 0, 0]), (len(anchors.positions), 4))
        total = 0.0
        for branch, (statistics, capture, view) in enumerate(
            zip(self._statistics, self._captures, batch, strict=False)
        ):
            camera = capture.views[view]
            rows = visible_rows(camera, anchors.positions, upright, np.exp(anchors.log_scalings[:, :3]))
            if branch and low is not None:
                rows = rows[~low[rows]]
            loss, gaussians, gradients = self.learner.differentiate(branch, camera, rows, view, self._weights[branch])
            total += loss
            if self._schedule.counts(iteration):
                statistics.add(rows, gaussians, screen_norms(camera, gaussians.means, gradients))
        self.learner.step(self._schedule.rates(iteration, self.pair.extent))
        if self._schedule.adjusts(iteration):
            self._adjust()
        return total

    def _adjust(self) -> None:
        """Grow anchors, then prune those that neither branch uses."""
        least_views = VISIBLE_SHARE * self._schedule.adjust_every
        new = self._grown(least_views / 2)
        measured = [s.views > least_views for s in self._statistics]
        transparent = [s.opacities < OPACITY_MIN * s.views for s in self._statistics]
        needed = [m & ~t for m, t in zip(measured, transparent, strict=True)]
        rows = np.flatnonzero(np.any(needed, axis=0) | ~np.any(measured, axis=0))
        for statistics, anchors in zip(self._statistics, measured, strict=True):
            statistics.reset(statistics.active_views > least_views / 2, anchors)
            statistics.replace_anchors(rows, len(new.positions))
        self.learner.replace_anchors(rows, new)
        if not len(rows) + len(new.positions):
            raise InputError("secure_gs", "anchors", expected="at least one", found="none: all became transparent")

    def _grown(self, least_views: float) -> Anchors:
        """Return new anchors near Gaussians of the scene and, our choice, of the message."""
        anchors = self.learner.anchors
        means = [statistics.means() for statistics in self._statistics]
        measured = [statistics.active_views > least_views for statistics in self._statistics]
        centres = anchors.positions[:, None] + anchors.offsets * np.exp(anchors.log_scalings[:, None, :3])
        positions = [centres, *(hidden for _, hidden in means[1:])]  # hidden Gaussians move with the view
        thresholds = [np.full(mask.shape, GRADIENT_THRESHOLD, np.float32) for mask in measured]
        if self.hides:
            growing = measured[1] & (means[1][0] >= GRADIENT_THRESHOLD)
            thresholds[0][self._masking(positions[1][growing], centres)] /= self._density
        features = np.broadcast_to(anchors.features[:, None], (*measured[0].shape, anchors.feat_dim))
        candidates = Candidates(
            *(
                np.concatenate([part[mask] for part, mask in zip(parts, measured, strict=True)])
                for parts in (positions, [norms for norms, _ in means], thresholds, [features] * len(measured))
            )
        )
        room = max(0, self._most_rows - len(anchors.positions))
        return grown(anchors.positions, candidates, self._voxel, anchors.k, room, self._rng)

    def _masking(self, hidden: Float32, centres: Float32) -> Bools:
        """Return the mask of the scene's Gaussians [M,k,3] in the region of growing hidden ones [C,3] (RDO)."""
        box = hidden_box(hidden, self._voxel) if self._density > 1 else None
        masking = inside(box, centres)
        self.boxed = max(self.boxed, float(masking.mean()))
        return masking
