"""Training: each iteration renders one view of the scene and of the message from the same anchors."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from gspure.errors import InputError
from gspure.schemes.hidden_weight import Hardening
from gspure.schemes.rows import screen_norms
from gspure.schemes.scheme import Run
from gspure.schemes.secure_gs.anchors import Anchors, Networks, visible_rows
from gspure.schemes.secure_gs.growing import GRADIENT_THRESHOLD, AnchorSchedule, Candidates, Statistics, grown, in_box
from gspure.schemes.secure_gs.learner import Learner
from gspure.schemes.secure_gs.model import AnchorModel
from gspure.training.pytorch import single_threaded

VISIBLE_SHARE: Final = 0.8  # least share of the views since the last adjustment that show a pruned anchor (Scaffold-GS)
OPACITY_MIN: Final = 0.005  # anchors with a lower sum of opacities, averaged over the views, are pruned (Scaffold-GS)


class Training:
    """A run; iterating over it trains and yields the loss of each iteration.

    The same arguments give the same bits with one thread of PyTorch. `voxel` is the side of the smallest cells, in
    world units; `branches` are the networks of the scene, and of the message unless a clean model is trained;
    `density` is r_down of RDO, 1 without it.
    """

    def __init__(self, run: Run, anchors: Anchors, voxel: float, branches: Sequence[Networks], density: float) -> None:
        self._run, self._voxel, self._density = run, voxel, density
        self._captures = [run.pair.scene, run.pair.message][: len(branches)]
        self.learner = Learner(anchors, branches, [c.images for c in self._captures], run.device)
        self._schedule = AnchorSchedule(run.iterations)
        self._hardening = Hardening(run, self._schedule.adjust_every)
        self._statistics = [Statistics(len(anchors.positions), anchors.k) for _ in branches]
        self._rng = np.random.default_rng(run.seed)

    def public(self) -> AnchorModel:
        """Return the current public model."""
        return AnchorModel(self.learner.anchors.table, self.learner.networks(0))

    def __iter__(self) -> Iterator[float]:
        batches = self._run.pair.batches(self._rng)
        with single_threaded():
            for iteration in range(1, self._run.iterations + 1):
                yield self._iterate(iteration, next(batches))
                self._hardening.follow(iteration, self.public)

    def _iterate(self, iteration: int, batch: tuple[int, int]) -> float:
        anchors, low = self.learner.anchors, self._hardening.left_out(iteration)
        upright = np.broadcast_to(np.array([1, 0, 0, 0]), (len(anchors.positions), 4))
        total = 0.0
        for branch, (statistics, capture) in enumerate(zip(self._statistics, self._captures, strict=True)):
            view, weight = batch[branch], (1.0, self._run.message_weight)[branch]
            camera = capture.views[view]
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
        measured = [s.views > least_views for s in self._statistics]
        transparent = [s.opacities < OPACITY_MIN * s.views for s in self._statistics]
        needed = [m & ~t for m, t in zip(measured, transparent, strict=True)]
        rows = np.flatnonzero(np.any(needed, axis=0) | ~np.any(measured, axis=0))
        for statistics, anchors in zip(self._statistics, measured, strict=True):
            statistics.restart(statistics.active_views > least_views / 2, anchors, rows, len(new.positions))
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
        if len(means) > 1 and self._density > 1:
            growing = measured[1] & (means[1][0] >= GRADIENT_THRESHOLD)
            thresholds[0][in_box(centres, positions[1][growing], self._voxel)] /= self._density
        features = np.broadcast_to(anchors.features[:, None], (*measured[0].shape, anchors.feat_dim))
        parts = (positions, [norms for norms, _ in means], thresholds, [features] * len(measured))
        chosen = ([part[mask] for part, mask in zip(of, measured, strict=True)] for of in parts)
        candidates = Candidates(*map(np.concatenate, chosen))
        room = max(0, self._run.most_rows - len(anchors.positions))
        return grown(anchors.positions, candidates, self._voxel, anchors.k, room, self._rng)
