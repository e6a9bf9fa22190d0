"""The schedule of training: Scaffold-GS's learning rates and anchor growing, for runs of any length.

The numbers are those of Scaffold-GS for its 30 000 iterations. A run of another length has each event at the same
fraction of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from gspure.training.schedule import ITERATIONS, LEAST_EVERY

OFFSETS_RATES: Final = (1e-2, 1e-4)  # first and last one, as a share of the scene's extent; log-linear between them

FEATURES_RATE: Final = 7.5e-3
SCALINGS_RATE: Final = 7e-3

NETWORK_RATES: Final = {"opacity": (2e-3, 2e-5), "cov": (4e-3, 4e-3), "color": (8e-3, 5e-5), "offset": (4e-3, 4e-5)}
"""First and last. The rate of SecureGS's offset network is ours: that of ``cov``, with the decay of offsets."""

COUNT_FROM: Final = 500
ADJUST_FROM: Final = 1_500
ADJUST_UNTIL: Final = 15_000
ADJUST_EVERY: Final = 100


@dataclass(frozen=True)
class AnchorSchedule:
    """A run's schedule. Iterations count from 1; events follow the optimizer step of their iteration.

    Statistics are collected after `count_from`, up to `adjust_until`. Anchors grow and are pruned at the multiples of
    `adjust_every` strictly between `adjust_from` and `adjust_until`.
    """

    iterations: int
    count_from: int
    adjust_from: int
    adjust_until: int
    adjust_every: int

    @classmethod
    def scaled(cls, iterations: int) -> AnchorSchedule:
        """Return Scaffold-GS's schedule for a run of this length."""
        count_from, adjust_from, adjust_until, every = (
            round(of * iterations / ITERATIONS) for of in (COUNT_FROM, ADJUST_FROM, ADJUST_UNTIL, ADJUST_EVERY)
        )
        return cls(iterations, count_from, adjust_from, adjust_until, max(every, LEAST_EVERY))

    def rates(self, iteration: int, extent: float) -> dict[str, float]:
        """Return the learning rates of one iteration by parameter; `extent` is the scene's, in world units."""
        share = iteration / self.iterations
        rates = {name: first * (last / first) ** share for name, (first, last) in NETWORK_RATES.items()}
        first, last = OFFSETS_RATES
        offsets = extent * first * (last / first) ** share
        return rates | {"offsets": offsets, "features": FEATURES_RATE, "log_scalings": SCALINGS_RATE}

    def counts(self, iteration: int) -> bool:
        """Tell whether statistics are collected at this iteration."""
        return self.count_from < iteration < self.adjust_until

    def adjusts(self, iteration: int) -> bool:
        """Tell whether anchors grow and are pruned after this iteration."""
        return self.adjust_from < iteration < self.adjust_until and iteration % self.adjust_every == 0
