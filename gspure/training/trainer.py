"""The training loop: a step on a random view, and between steps what the schedule asks for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from gspure.cameras import Camera
from gspure.errors import InputError
from gspure.opencl.trainable import Parameters, TrainableModel, TrainState
from gspure.training.checkpoints import Snapshot
from gspure.training.densification import densify, reset_opacities
from gspure.training.schedule import Schedule

RECOVERY: Final = 150
"""Iterations within which images are about as good again as before a reset of opacities."""


class Trainer:
    """One run; iterating over it trains, and yields the loss of each iteration.

    The same snapshot, views and schedule give the same model to the last bit, whether the run was interrupted or not.

    Parameters
    ----------
    model : TrainableModel
        Begun from ``snapshot.state`` with ``snapshot.iteration`` steps done, the photographs of `views` its targets.
    views : sequence of Camera
        The training views.
    schedule : Schedule
    snapshot : Snapshot
        Where to begin: `beginning`, or a checkpoint.
    extent : float
        Of the scene, in world units.
    background : sequence of 3 floats
        Colour behind the model.
    max_gaussians : int, optional
        More than that do not grow.

    """

    def __init__(
        self,
        model: TrainableModel,
        views: Sequence[Camera],
        schedule: Schedule,
        snapshot: Snapshot,
        *,
        extent: float,
        background: Sequence[float] = (0.0, 0.0, 0.0),
        max_gaussians: int | None = None,
    ) -> None:
        self.model = model
        self.iteration = snapshot.iteration
        self._views = views
        self._schedule = schedule
        self._extent = extent
        self._background = background
        self._max_gaussians = max_gaussians
        self._unseen = list(snapshot.unseen)
        self._rng = np.random.default_rng()
        self._rng.bit_generator.state = dict(snapshot.rng)

    def __iter__(self) -> Iterator[float]:
        while self.iteration < self._schedule.iterations:
            yield self._iterate()

    @property
    def recovering_from(self) -> int | None:
        """The iteration of the last reset of opacities, as long as images are still darker for it."""
        last = self._schedule.last_reset(self.iteration)
        return last if last and self.iteration - last < RECOVERY else None

    @property
    def rests(self) -> bool:
        """Whether `snapshot` can be taken now."""
        return self._schedule.rests(self.iteration)

    def snapshot(self) -> Snapshot:
        """Return all that the rest of the run depends on; only where it `rests`."""
        if not self.rests:
            raise RuntimeError(f"statistics are under way at iteration {self.iteration}")
        return Snapshot(self.iteration, self.model.state(), tuple(self._unseen), self._rng.bit_generator.state)

    def _iterate(self) -> float:
        iteration = self.iteration = self.iteration + 1
        self.model.sh_degree_active = self._schedule.sh_degree(iteration)
        view = self._next_view()
        rates = self._schedule.rates(iteration, self._extent)
        loss = self.model.step(self._views[view], view, rates, background=self._background)
        if self._schedule.densifies(iteration):
            state = self._densified()
            self.model.replace(reset_opacities(state) if self._schedule.resets_opacities(iteration) else state)
        return loss

    def _next_view(self) -> int:
        """Take views at random, none again before all have been taken."""
        if not self._unseen:
            self._unseen = self._rng.permutation(len(self._views)).tolist()
        return self._unseen.pop()

    def _densified(self) -> TrainState:
        state = densify(
            self.model.state(),
            self.model.statistics(),
            extent=self._extent,
            prune_big=self._schedule.prunes_big(self.iteration),
            rng=self._rng,
            max_gaussians=self._max_gaussians,
        )
        if not len(state.parameters):
            found = f"none after iteration {self.iteration}"
            hint = "every one became transparent; do the views and the points belong together?"
            raise InputError("training", "Gaussians", expected="at least one", found=found, hint=hint)
        return state


def beginning(parameters: Parameters, seed: int) -> Snapshot:
    """Return the snapshot of a run that has not begun."""
    return Snapshot(0, TrainState.fresh(parameters), (), np.random.default_rng(seed).bit_generator.state)
