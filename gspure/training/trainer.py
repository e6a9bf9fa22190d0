"""The training loop: steps on random views, densification and opacity resets, and its progress."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final

import numpy as np

from gspure.arrays import Float32
from gspure.cameras import Camera
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.opencl.device import Device
from gspure.opencl.trainable import DensificationStatistics, Parameters, TrainableModel, TrainState
from gspure.progress import bar, reported, say, shows_bars
from gspure.training.dataset import reduced
from gspure.training.densification import grow, plan, reset_opacities
from gspure.training.output import Snapshot, as_gaussians
from gspure.training.schedule import Schedule

_SECONDS: Final = 10.0  # between two reports


class Trainer:
    """A run; iterating over it trains and yields the loss of each iteration.

    The same snapshot, views and schedule give a bit-identical model, whether or not the run was interrupted. The model
    was created from `snapshot`, which is the `beginning` or a checkpoint; `images` are the photographs of `views`.
    `extent` is that of the scene in world units, `max_gaussians` the upper bound of growth.
    """

    def __init__(
        self,
        model: TrainableModel,
        views: Sequence[Camera],
        images: Sequence[Float32],
        schedule: Schedule,
        snapshot: Snapshot,
        *,
        extent: float,
        background: Sequence[float] = (0.0, 0.0, 0.0),
        max_gaussians: int | None = None,
    ) -> None:
        self.model = model
        self.iteration = snapshot.iteration
        self._full_views = views
        self._images = images
        self._views = views
        self._reduction = 0  # of the photographs on the device; none yet
        self.schedule = schedule
        self._extent = extent
        self._background = background
        self._max_gaussians = max_gaussians
        self._pending_views = list(snapshot.pending_views)
        self._rng = np.random.default_rng()
        self._rng.bit_generator.state = dict(snapshot.rng)

    def __iter__(self) -> Iterator[float]:
        while self.iteration < self.schedule.iterations:
            yield self._iterate()

    @property
    def rests(self) -> bool:
        """Whether `snapshot` can be taken now."""
        return self.schedule.rests(self.iteration)

    def snapshot(self) -> Snapshot:
        """Return the state of the run; only while it `rests`."""
        return Snapshot(self.iteration, self.model.state(), tuple(self._pending_views), self._rng.bit_generator.state)

    def _iterate(self) -> float:
        self.iteration += 1
        iteration = self.iteration
        self.model.sh_degree_active = self.schedule.sh_degree(iteration)
        self._show(self.schedule.reduction(iteration))
        if not self._pending_views:  # a new random order after each pass
            self._pending_views = self._rng.permutation(len(self._views)).tolist()
        view = self._pending_views.pop()
        rates = self.schedule.rates(iteration, self._extent)
        loss = self.model.step(
            self._views[view],
            view,
            rates,
            background=self._background,
            ssim_weight=self.schedule.ssim_weight,
        )
        if self.schedule.densifies(iteration):
            after = densified(
                [self.model.state()],
                self.model.statistics(),
                self.schedule,
                iteration,
                extent=self._extent,
                rng=self._rng,
                max_gaussians=self._max_gaussians,
            )
            self.model.replace(*after)
        return loss

    def _show(self, reduction: int) -> None:
        """Put the photographs on the device, with their sides divided by `reduction`."""
        if reduction == self._reduction:
            return
        self._reduction = reduction
        self._views, images = reduced(self._full_views, self._images, reduction)
        self.model.set_targets(images)


def train(
    views: Sequence[Camera],
    images: Sequence[Float32],
    begin: Snapshot,
    *,
    schedule: Schedule,
    extent: float,
    max_gaussians: int,
    device: Device | None,
    background: Sequence[float] = (0.0, 0.0, 0.0),
) -> Gaussians:
    """Return a 3DGS model trained on images of views."""
    model = TrainableModel(begin.state, device=device)
    trainer = Trainer(
        model,
        views,
        images,
        schedule,
        begin,
        extent=extent,
        background=background,
        max_gaussians=max_gaussians,
    )
    for _ in watched(trainer, schedule.iterations, lambda: f"{model.count} Gaussians"):
        pass
    return as_gaussians(model.state().parameters)


def beginning(parameters: Parameters, seed: int) -> Snapshot:
    """Return the snapshot before the first iteration."""
    return Snapshot(0, TrainState.fresh(parameters), (), np.random.default_rng(seed).bit_generator.state)


def densified(
    states: Sequence[TrainState],
    statistics: DensificationStatistics,
    schedule: Schedule,
    iteration: int,
    *,
    extent: float,
    rng: np.random.Generator,
    max_gaussians: int | None,
    opacities: Float32 | None = None,
) -> list[TrainState]:
    """Return the states of the same rows after densification and, where the schedule says so, a reset of opacities.

    The first state decides. `opacities` [K] decide about pruning, by default those of the first state.
    """
    budget = None if max_gaussians is None else schedule.budget(max_gaussians, iteration)
    growth = plan(
        states[0].parameters,
        statistics,
        opacities,
        extent=extent,
        prune_big=schedule.prunes_big(iteration),
        rng=rng,
        max_gaussians=budget,
    )
    after = [grow(state, growth) for state in states]
    if not len(after[0].parameters):
        count = f"none after iteration {iteration}"
        hint = "every one became transparent; do the views and the points belong together?"
        raise InputError("training", "Gaussians", expected="at least one", found=count, hint=hint)
    return [reset_opacities(state) for state in after] if schedule.resets_opacities(iteration) else after


def watched(losses: Iterable[float], iterations: int, state: Callable[[], str], done: int = 0) -> Iterator[float]:
    """Yield `losses`, one per iteration, and report their mean since the last report, `state` and speed.

    `state` describes the current model, such as ``"PSNR 30.12 12000 Gaussians"``, and is called once per report. The
    run resumes after `done` iterations. On a terminal, a bar shows its progress.
    """
    if shows_bars():
        losses = bar(losses, "train", iterations - done)
    losses = reported(losses, "train", iterations, done)
    recent: list[float] = []
    last = time.monotonic()
    for iteration, loss in enumerate(losses, done + 1):
        yield loss
        recent.append(loss)
        seconds = time.monotonic() - last
        if seconds > _SECONDS or iteration == iterations:
            speed = f"{len(recent) / seconds:.1f} it/s"
            say(f"train: {iteration} of {iterations}  loss {np.mean(recent):.4f}  {state()}  {speed}")
            recent = []
            last = time.monotonic()
