"""The training loop: each iteration, one view of the scene and of the message over the same anchors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.errors import InputError
from gspure.opencl.device import Device
from gspure.schemes.pair import Pair
from gspure.schemes.secure_gs.anchors import Anchors
from gspure.schemes.secure_gs.density import hidden_box, inside
from gspure.schemes.secure_gs.growing import GRADIENT_THRESHOLD, Candidates, grown
from gspure.schemes.secure_gs.learner import Learner
from gspure.schemes.secure_gs.networks import Networks
from gspure.schemes.secure_gs.schedule import AnchorSchedule
from gspure.schemes.secure_gs.statistics import Statistics, screen_norms
from gspure.schemes.secure_gs.visibility import visible_rows

SEEN_SHARE: Final = 0.8
"""An anchor is judged once more than this share of the views between two adjustments had it (Scaffold-GS)."""

OPACITY_MIN: Final = 0.005
"""An anchor whose Gaussians' opacities add up to less, on average over the views, goes (Scaffold-GS)."""

Float32 = NDArray[np.float32]


class Training:
    """One run; iterating over it trains, and yields the loss of each iteration.

    The same arguments give the same bits, on one thread of PyTorch's.

    Parameters
    ----------
    pair : Pair
    anchors : Anchors
        Where they start.
    voxel : float
        Side of the finest cells, world units.
    branches : sequence of Networks
        The scene's, and the message's if one is hidden.
    iterations : int
    message_weight : float
        lambda in L = L_scene + lambda L_message.
    density : float
        r_down of RDO; 1 switches it off.
    max_anchors : int
        More than that do not grow.
    seed : int
    device : Device

    """

    def __init__(
        self,
        pair: Pair,
        anchors: Anchors,
        voxel: float,
        branches: Sequence[Networks],
        iterations: int,
        *,
        message_weight: float,
        density: float,
        max_anchors: int,
        seed: int,
        device: Device,
    ) -> None:
        self.pair = pair
        self.learner = Learner(anchors, branches, [pair.scene, pair.message][: len(branches)], device)
        self.boxed = 0.0
        self._voxel = voxel
        self._weights = (1.0, message_weight)
        self._density = density
        self._max_anchors = max_anchors
        self._schedule = AnchorSchedule.scaled(iterations)
        self._statistics = [Statistics(len(anchors.positions), anchors.k) for _ in branches]
        self._rng = np.random.default_rng(seed)

    @property
    def hides(self) -> bool:
        """Whether there is a hidden branch."""
        return len(self._statistics) > 1

    def __iter__(self) -> Iterator[float]:
        unseen: list[int] = []
        for iteration in range(1, self._schedule.iterations + 1):
            unseen = unseen or self._rng.permutation(len(self.pair.views)).tolist()
            yield self._iterate(iteration, unseen.pop())

    def _iterate(self, iteration: int, view: int) -> float:
        camera, anchors = self.pair.views[view], self.learner.anchors
        upright = np.tile(np.array([1, 0, 0, 0]), (len(anchors.positions), 1))
        rows = visible_rows(camera, anchors.positions, upright, np.exp(anchors.log_scalings[:, :3]))
        total = 0.0
        for branch, statistics in enumerate(self._statistics):
            loss, found, gradients = self.learner.differentiate(branch, camera, rows, view, self._weights[branch])
            total += loss
            if self._schedule.counts(iteration):
                statistics.note(rows, found, screen_norms(camera, found.means, gradients))
        self.learner.step(self._schedule.rates(iteration, self.pair.dataset.extent))
        if self._schedule.adjusts(iteration):
            self._adjust()
        return total

    def _adjust(self) -> None:
        """Let anchors grow, then prune those that neither branch uses."""
        visits = SEEN_SHARE * self._schedule.adjust_every
        new = self._grown(visits / 2)
        judged = [statistics.visits > visits for statistics in self._statistics]
        clear = [s.opacities < OPACITY_MIN * s.visits for s in self._statistics]
        kept = np.flatnonzero(~np.all([*judged, *clear], axis=0))
        for statistics, anchors in zip(self._statistics, judged, strict=True):
            statistics.forget(statistics.seen > visits / 2, anchors)
            statistics.follow(kept, len(new.positions))
        self.learner.follow(kept, new)
        if not len(kept) + len(new.positions):
            raise InputError("secure_gs", "anchors", expected="at least one", found="none: all became transparent")

    def _grown(self, least_views: float) -> Anchors:
        """Return new anchors: beside Gaussians of the scene, and of the message, which needs some of its own (ours)."""
        anchors = self.learner.anchors
        means = [statistics.means() for statistics in self._statistics]
        known = [statistics.seen > least_views for statistics in self._statistics]
        reached = anchors.positions[:, None] + anchors.offsets * np.exp(anchors.log_scalings[:, None, :3])
        places = [reached, *(hidden for _, hidden in means[1:])]  # hidden Gaussians move with the view
        thresholds = [np.full(mask.shape, GRADIENT_THRESHOLD, np.float32) for mask in known]
        if self.hides:
            asking = known[1] & (means[1][0] >= GRADIENT_THRESHOLD)
            thresholds[0][self._masking(places[1][asking], reached)] /= self._density
        features = np.broadcast_to(anchors.features[:, None], (*known[0].shape, anchors.feat_dim))
        candidates = Candidates(
            *(
                np.concatenate([part[mask] for part, mask in zip(parts, known, strict=True)])
                for parts in (places, [norms for norms, _ in means], thresholds, [features] * len(known))
            )
        )
        room = max(0, self._max_anchors - len(anchors.positions))
        return grown(anchors.positions, candidates, self._voxel, anchors.k, room, self._rng)

    def _masking(self, hidden: Float32, reached: Float32) -> NDArray[np.bool_]:
        """Tell which of the scene's Gaussians [M,k] lie where hidden ones [C,3] ask for more (RDO)."""
        box = hidden_box(hidden, self._voxel) if self._density > 1 else None
        masking = inside(box, reached)
        self.boxed = max(self.boxed, float(masking.mean()))
        return masking
