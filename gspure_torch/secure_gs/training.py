"""Training: each iteration renders one view of the scene and of the message from the same anchors."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from gspure.arrays import Bools, Float32
from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.schemes.hidden_weight import Hardening
from gspure.schemes.scheme import Run
from gspure.training.dataset import reduced
from gspure.training.fast import schedule_of
from gspure_torch.pytorch import single_threaded
from gspure_torch.rows import screen_norms
from gspure_torch.secure_gs.anchors import Anchors, Networks, visible_rows
from gspure_torch.secure_gs.growing import (
    GRADIENT_THRESHOLD,
    STAGES,
    AnchorSchedule,
    AnchorStatistics,
    Candidates,
    grown,
    in_box,
)
from gspure_torch.secure_gs.learner import Learner
from gspure_torch.secure_gs.model import AnchorModel

VISIBLE_SHARE: Final = 0.8  # least share of the views since the last adjustment that show a pruned anchor (Scaffold-GS)
OPACITY_MIN: Final = 0.005  # anchors with a lower sum of opacities, averaged over the views, are pruned (Scaffold-GS)


class Training:
    """A run; iterating over it trains and yields the loss of each iteration.

    The same arguments give the same bits with one thread of PyTorch. `voxel` is the side of the smallest cells, in
    world units; `branches` are the networks of the scene, and of the message unless a clean model is trained;
    `density` is r_down of RDO, 1 without it.
    """

    def __init__(self, run: Run, anchors: Anchors, voxel: float, branches: Sequence[Networks], density: float) -> None:
        self._run = run
        self._voxel = voxel
        self._density = density
        self._captures = [run.pair.scene]
        if len(branches) > 1:
            self._captures.append(run.pair.message)
        self.learner = Learner(anchors, branches, run.device)
        self._sizes = schedule_of(run.schedule, run.iterations, stages=STAGES)
        self._schedule = AnchorSchedule(run.iterations, self._sizes.full_size_from)
        self._views: list[Sequence[Camera]] = []
        self._reduction = 0
        self._hardening = Hardening(run, self._schedule.adjust_every)
        self._statistics = [AnchorStatistics(len(anchors.positions), anchors.k) for _ in branches]
        self._rng = np.random.default_rng(run.seed)

    def public(self) -> AnchorModel:
        """Return the current public model."""
        return AnchorModel(self.learner.anchors.table, self.learner.networks(0))

    def __iter__(self) -> Iterator[float]:
        batches = self._run.pair.batches(self._rng)
        with single_threaded():
            for iteration in range(1, self._run.iterations + 1):
                self._show(self._sizes.reduction(iteration))
                yield self._iterate(iteration, next(batches))
                self._hardening.follow(iteration, self.public)

    def _show(self, reduction: int) -> None:
        """Show the learner photographs whose sides are divided by `reduction`."""
        if reduction == self._reduction:
            return
        self._reduction = reduction
        shown = [reduced(capture.views, capture.images, reduction) for capture in self._captures]
        self._views = [views for views, _ in shown]
        self.learner.show([images for _, images in shown])

    def _iterate(self, iteration: int, batch: tuple[int, int]) -> float:
        anchors = self.learner.anchors
        low = self._hardening.left_out(iteration)
        upright = np.broadcast_to(np.array([1, 0, 0, 0]), (len(anchors.positions), 4))
        total = 0.0
        for branch, (statistics, views) in enumerate(zip(self._statistics, self._views, strict=True)):
            view = batch[branch]
            weight = self._run.message_weight if branch else 1.0
            camera = views[view]
            rows = visible_rows(camera, anchors.positions, upright, np.exp(anchors.log_scalings[:, :3]))
            if branch and low is not None:
                rows = rows[~low[rows]]
            loss, gaussians, gradients = self.learner.differentiate(branch, camera, rows, view, weight)
            total += loss
            if self._schedule.counts(iteration):
                statistics.add(rows, gaussians, screen_norms(camera, gaussians.means, gradients))
        self.learner.step(self._schedule.rates(iteration, self._run.pair.extent))
        if self._schedule.adjusts(iteration):
            self._adjust()
        return total

    def _adjust(self) -> None:
        """Grow anchors, then prune those that neither branch uses."""
        least_views = VISIBLE_SHARE * self._schedule.adjust_every
        new = self._grown(least_views / 2)
        measured: list[Bools] = []
        needed: list[Bools] = []
        for statistics in self._statistics:
            is_measured = statistics.views > least_views
            is_transparent = statistics.opacities < OPACITY_MIN * statistics.views
            measured.append(is_measured)
            needed.append(is_measured & ~is_transparent)
        rows = np.flatnonzero(np.any(needed, axis=0) | ~np.any(measured, axis=0))
        for statistics, is_measured in zip(self._statistics, measured, strict=True):
            statistics.restart(statistics.active_views > least_views / 2, is_measured, rows, len(new.positions))
        self.learner.replace_anchors(rows, new)
        if not len(rows) + len(new.positions):
            raise InputError("secure_gs", "anchors", expected="at least one", found="none: all became transparent")

    def _grown(self, least_views: float) -> Anchors:
        """Return new anchors near Gaussians of the scene and (our choice) of the message."""
        anchors = self.learner.anchors
        scene_positions = anchors.positions[:, None] + anchors.offsets * np.exp(anchors.log_scalings[:, None, :3])
        positions = [scene_positions]
        positions += [statistics.mean_centres() for statistics in self._statistics[1:]]  # these move with the view
        norms = [statistics.mean_norms() for statistics in self._statistics]
        measured = [statistics.active_views > least_views for statistics in self._statistics]
        thresholds = [np.full(mask.shape, GRADIENT_THRESHOLD, np.float32) for mask in measured]
        if len(self._statistics) > 1 and self._density > 1:
            growing = measured[1] & (norms[1] >= GRADIENT_THRESHOLD)
            region = in_box(scene_positions, positions[1][growing], self._voxel)
            thresholds[0][region] /= self._density
        features = np.broadcast_to(anchors.features[:, None], (*measured[0].shape, anchors.feat_dim))
        candidates = Candidates(
            positions=_selected(positions, measured),
            norms=_selected(norms, measured),
            thresholds=_selected(thresholds, measured),
            features=_selected([features for _ in measured], measured),
        )
        room = max(0, self._run.most_rows - len(anchors.positions))
        return grown(anchors.positions, candidates, self._voxel, anchors.k, room, self._rng)


def _selected(arrays: Sequence[Float32], masks: Sequence[Bools]) -> Float32:
    """Return the elements of each branch's array that its mask selects, branch after branch."""
    return np.concatenate([array[mask] for array, mask in zip(arrays, masks, strict=True)])
