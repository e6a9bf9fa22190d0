r"""Bootstrap intervals of a mean over scenes and seeds.

Scenes are drawn with replacement, then seeds within each drawn scene (Efron and Tibshirani 1993, §8; Davison and
Hinkley 1997, §3.8). The second draw counts the spread between seeds twice, which errs on the wide side.

The plain percentile interval is too narrow for few scenes. So its tails are those of the expanded percentile interval
(Hesterberg 2015),

.. math:: \frac{\alpha'}{2} = \Phi\left(-\sqrt{\frac{n}{n-1}}\, t_{1-\alpha/2,\, n-1}\right),

which for normal data amounts to Student's interval.

No resampling helps where there is next to nothing to resample. The smallest and the largest of :math:`n` independent
scenes enclose the median of all scenes with probability :math:`1 - 2^{1-n}`, whatever their distribution; below six
scenes that is less than 95 %, and then this range is given for what it is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gspure.evaluation.statistics.cells import Cells, Groups, by_scene, checked

LEVEL: Final = 0.95
"""Nominal probability that an interval covers what it estimates."""

RESAMPLES: Final = 10_000
"""Ours. The tails of six scenes then still hold some 20 resamples."""

SEED: Final = 0


class Interval(NamedTuple):
    """A mean, and where it would lie had other scenes and seeds been drawn."""

    mean: float
    """The mean of the scenes' means: each scene counts the same, however many seeds it has."""

    low: float
    high: float

    level: float
    """`LEVEL` for a bootstrap interval; less for a range of few scenes, and 0 for a single one."""

    scenes: int

    @property
    def excludes_zero(self) -> bool:
        """Whether all of the interval has one sign; below six scenes, whether all scenes have it."""
        return self.low > 0 or self.high < 0

    def __str__(self) -> str:
        if self.level >= LEVEL:
            return f"{self.mean:.2f} [{self.low:.2f}, {self.high:.2f}]"
        if self.scenes == 1:
            return f"{self.mean:.2f} (one scene)"
        return f"{self.mean:.2f} ({self.scenes} scenes: {self.low:.2f} to {self.high:.2f})"


def mean_interval(values: Sequence[ArrayLike]) -> Interval:
    """Return the mean over scenes with its interval.

    Parameters
    ----------
    values : sequence of array [seeds]
        For every scene the values of its seeds; scenes may have different numbers of seeds.

    Returns
    -------
    Interval
        From six scenes on, the expanded percentile interval at `LEVEL`. With fewer, the range of the scenes' means,
        with the probability at which that encloses the median scene: 75 % for three, 94 % for five.

    Raises
    ------
    InputError
        If there is nothing to average, or a value is not finite.

    """
    groups = checked(values)
    means = np.array([group.mean() for group in groups])
    level_of_range = 1 - 2.0 ** (1 - len(groups))
    if level_of_range < LEVEL:
        low, high, level = means.min(), means.max(), level_of_range
    else:
        (low, high), level = np.quantile(_resampled_means(groups), _tails(len(groups))), LEVEL
    return Interval(float(means.mean()), float(low), float(high), level, len(groups))


def known_interval(cells: Cells) -> Interval | None:
    """Return the mean over scenes of the finite numbers, with its interval; None if there are none."""
    known = by_scene({cell: value for cell, value in cells.items() if math.isfinite(value)})
    return mean_interval(known) if known else None


def _resampled_means(groups: Groups) -> np.ndarray:
    """Return `RESAMPLES` means of scenes drawn with replacement, and seeds drawn with replacement within them."""
    rng = np.random.default_rng(SEED)
    counts = np.array([len(group) for group in groups])
    starts = np.cumsum(counts) - counts
    flat = np.concatenate(groups)
    scenes = rng.integers(len(groups), size=(RESAMPLES, len(groups)))
    total = np.zeros(scenes.shape)
    for seed in range(counts.max()):
        drawn = flat[starts[scenes] + (rng.random(scenes.shape) * counts[scenes]).astype(np.intp)]
        total += np.where(seed < counts[scenes], drawn, 0.0)
    return np.asarray((total / counts[scenes]).mean(axis=1))


def _tails(scenes: int) -> tuple[float, float]:
    from scipy.special import ndtr, stdtrit

    tail = float(ndtr(-np.sqrt(scenes / (scenes - 1)) * stdtrit(scenes - 1, (1 + LEVEL) / 2)))
    return tail, 1 - tail
