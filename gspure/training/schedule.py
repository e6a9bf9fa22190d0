"""The schedule of a training run: learning rates, spherical-harmonic degree, densification, opacity resets.

The numbers are those of 3DGS (Kerbl et al. 2023, section 7.1 and the appendix) for its 30 000 iterations. A run of
another length has each event at the same fraction of it. Periods have a lower bound, so that gradients of enough views
are collected.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Final, Self

import numpy as np

from gspure.constants import MAX_SH_DEGREE
from gspure.opencl.adam import LearningRates
from gspure.opencl.losses import SSIM_WEIGHT

ITERATIONS: Final = 30_000  # length of 3DGS's own schedule
MEANS_RATES: Final = (1.6e-4, 1.6e-6)  # first and last one, as a share of the scene's extent; log-linear between them
QUATS_RATE: Final = 1e-3
SCALES_RATE: Final = 5e-3
OPACITIES_RATE: Final = 0.05  # as in the paper's release; later releases halve it
SH_DC_RATE: Final = 2.5e-3
SH_REST_RATE: Final = SH_DC_RATE / 20

SH_EVERY: Final = 1_000  # iterations after which the degree of spherical harmonics rises by one
DENSIFY_FROM: Final = 500
DENSIFY_EVERY: Final = 100
DENSIFY_UNTIL: Final = ITERATIONS // 2
RESET_EVERY: Final = 3_000

LEAST_FROM: Final = 150  # lower bounds for short runs; ours: 3DGS has none
LEAST_EVERY: Final = 50
LEAST_RESET: Final = 600


@dataclass(frozen=True)
class Schedule:
    """A run's schedule. Iterations count from 1; events follow the optimizer step of their iteration.

    A band of spherical harmonics is added every `sh_every` iterations. Densification happens at the multiples of
    `densify_every` strictly between `densify_from` and `densify_until`. Opacities are reset, after densification, at
    the multiples of `reset_every`, a multiple of `densify_every`, before `densify_until`; after the first reset, big
    Gaussians are pruned too.
    """

    pixels_per_gaussian: ClassVar[int] = 1  # of the largest view, for the default bound of growth
    needs_surfaces: ClassVar[bool] = False  # whether random initial points are replaced by some on surfaces

    iterations: int
    sh_every: int
    densify_from: int
    densify_until: int
    densify_every: int
    reset_every: int
    ssim_weight: float = SSIM_WEIGHT  # share of 1 - SSIM in the loss

    @classmethod
    def scaled(cls, iterations: int) -> Self:
        """Return 3DGS's schedule for a run of this length."""

        def share(published: int, least: int) -> int:
            return max(least, round(published * iterations / ITERATIONS))

        densify_every = share(DENSIFY_EVERY, LEAST_EVERY)
        return cls(
            iterations=iterations,
            sh_every=share(SH_EVERY, 1),
            densify_from=share(DENSIFY_FROM, LEAST_FROM),
            densify_until=share(DENSIFY_UNTIL, 1),
            densify_every=densify_every,
            reset_every=densify_every * round(share(RESET_EVERY, LEAST_RESET) / densify_every),
        )

    def of_photographs(self) -> Self:
        """Return the schedule of a run that learns from photographs, not from renders."""
        return self

    def rates(self, iteration: int, extent: float) -> LearningRates:
        """Return the learning rates of one iteration; `extent` is the scene's, in world units."""
        first, last = MEANS_RATES
        means = extent * first * (last / first) ** (iteration / self.iterations)
        return LearningRates(means, QUATS_RATE, SCALES_RATE, OPACITIES_RATE, SH_DC_RATE, SH_REST_RATE)

    def settling(self, iteration: int) -> float:
        """Return the factor of networks' learning rates: 1 while Gaussians grow, then falling linearly to 0.

        Ours, as 3DGS has no networks: at a constant rate, their last steps add noise to the image.
        """
        left = self.iterations + 1 - iteration
        return min(1.0, left / (self.iterations + 1 - self.densify_until))

    def sh_degree(self, iteration: int) -> int:
        """Return the degree of the spherical harmonics in one iteration."""
        return min(MAX_SH_DEGREE, iteration // self.sh_every)

    def densifies(self, iteration: int) -> bool:
        """Tell whether Gaussians are cloned, split and pruned after this iteration."""
        return self.densify_from < iteration < self.densify_until and iteration % self.densify_every == 0

    def resets_opacities(self, iteration: int) -> bool:
        """Tell whether opacities are reset after this iteration."""
        return iteration < self.densify_until and iteration % self.reset_every == 0

    def prunes_big(self, iteration: int) -> bool:
        """Tell whether densification after this iteration prunes big Gaussians too."""
        return iteration > self.reset_every

    def reduction(self, iteration: int) -> int:  # noqa: ARG002
        """Return the factor by which the sides of photographs are smaller in one iteration."""
        return 1

    def budget(self, most: int, iteration: int) -> int:  # noqa: ARG002
        """Return the largest number of Gaussians after one iteration, if the run allows `most` in all."""
        return most

    @property
    def full_size_from(self) -> float:
        """The share of the run after which photographs have their full size."""
        return 0.0

    def rests(self, iteration: int) -> bool:
        """Tell whether no statistics are being collected, so that the model's state is the state of the run."""
        return self.densifies(iteration) or iteration >= self.densify_until


def shuffled(count: int, rng: np.random.Generator) -> Iterator[int]:
    """Yield random permutations of the numbers below `count`, one after the other, for ever."""
    while True:
        yield from rng.permutation(count).tolist()
