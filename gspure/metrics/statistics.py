r"""Numbers by scene and seed, and bootstrap intervals of their means.

Views of a scene and seeds of one embedding are not independent, so the scene is the unit everywhere.

Scenes are drawn with replacement, then seeds within each drawn scene (Efron and Tibshirani 1993, §8; Davison and
Hinkley 1997, §3.8). The tails are those of the expanded percentile interval (Hesterberg 2015),

.. math:: \frac{\alpha'}{2} = \Phi\left(-\sqrt{\frac{n}{n-1}}\, t_{1-\alpha/2,\, n-1}\right),

which for normal data is close to Student's interval.

The smallest and the largest of :math:`n` independent scenes enclose the median of all scenes with probability
:math:`1 - 2^{1-n}`, whatever the distribution. With fewer than six scenes, the interval is this range, and this
probability its level.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gspure.arrays import Float64
from gspure.grouping import grouped

LEVEL: Final = 0.95  # nominal coverage of an interval
ROUNDING: Final = 1e-9  # relative error of sums and differences, far below what images of 8 bits distinguish
RESAMPLES: Final = 10_000  # the tails of six scenes then hold some 20 resamples
SEED: Final = 0

Cells = Mapping[tuple[str, int], float]  # a number for every (scene, seed)
Groups = list[Float64]


class Interval(NamedTuple):
    """A mean with its interval over scenes and seeds."""

    mean: float  # the mean of the scenes' means: every scene counts the same, whatever its number of seeds
    low: float
    high: float
    level: float  # `LEVEL` for a bootstrap interval; lower for the range of a few scenes, and 0 for a single scene
    scenes: int


def by_scene(cells: Mapping[tuple[str, int], ArrayLike]) -> Groups:
    """Return one array per scene with the values of its seeds; scenes and seeds in sorted order."""
    cells_of_scenes = grouped(sorted(cells), lambda cell: cell[0])
    return [np.array([cells[cell] for cell in alike], np.float64) for alike in cells_of_scenes.values()]


def scene_means(cells: Mapping[tuple[str, int], ArrayLike]) -> dict[str, Any]:
    """Return the mean over seeds for every scene, in sorted order; values are numbers, or arrays of one shape."""
    scenes = dict.fromkeys(scene for scene, _ in sorted(cells))
    with np.errstate(invalid="ignore"):  # infinities of both signs have no mean: NaN
        return {scene: values.mean(axis=0) for scene, values in zip(scenes, by_scene(cells), strict=True)}


def differences(a: Cells, b: Cells) -> Cells:
    """Return the `difference` ``a - b`` of every cell that both have."""
    return {cell: difference(a[cell], b[cell]) for cell in a.keys() & b.keys()}


def difference(a: float, b: float) -> float:
    """Return ``a - b``, but 0 if the difference may be rounding error alone."""
    return _without_noise(a - b, a)


def in_order(values: Sequence[ArrayLike]) -> Groups:
    """Return the values in a canonical order, so that equal data gives equal bits in any order of scenes and seeds."""
    groups = [np.sort(np.asarray(group, np.float64).ravel()) for group in values]
    return sorted(groups, key=lambda group: (group.mean(), *group))


def means_of(groups: Groups) -> Float64:
    """Return the mean of each group, or 0 if it may differ from 0 by rounding error alone."""
    return np.array([_without_noise(float(group.mean()), float(np.abs(group).max())) for group in groups])


def mean_interval(values: Sequence[ArrayLike]) -> Interval:
    """Return the mean over scenes with its interval; `values` hold one array per scene: its seeds, all finite."""
    groups = in_order(values)
    means = means_of(groups)
    level_of_range = 1 - 2.0 ** (1 - len(groups))
    mean = _without_noise(float(means.mean()), float(np.abs(means).max()))
    if level_of_range < LEVEL:
        return Interval(mean, float(means.min()), float(means.max()), level_of_range, len(groups))
    low, high = np.quantile(_resampled_means(groups), _tails(len(groups)))
    return Interval(mean, float(low), float(high), LEVEL, len(groups))


def _without_noise(total: float, magnitude: float) -> float:
    """Return a sum, but 0 if it may be the rounding error of terms of this magnitude."""
    return 0.0 if abs(total) <= ROUNDING * abs(magnitude) < math.inf else total


def known_interval(cells: Cells) -> Interval | None:
    """Return the mean over scenes of the finite values, with its interval; None without a finite value."""
    known = by_scene({cell: value for cell, value in cells.items() if math.isfinite(value)})
    return mean_interval(known) if known else None


def _resampled_means(groups: Groups) -> np.ndarray:
    """Return `RESAMPLES` means: scenes are drawn with replacement, and so are the seeds within each drawn scene."""
    rng = np.random.default_rng(SEED)
    counts = np.array([len(group) for group in groups])
    starts = np.cumsum(counts) - counts
    flat = np.concatenate(groups)
    scenes = rng.integers(len(groups), size=(RESAMPLES, len(groups)))
    total = np.zeros(scenes.shape)
    for seed in range(counts.max()):
        seeds = (rng.random(scenes.shape) * counts[scenes]).astype(np.intp)
        values = flat[starts[scenes] + seeds]
        total += np.where(seed < counts[scenes], values, 0.0)
    return np.asarray((total / counts[scenes]).mean(axis=1))


def _tails(scenes: int) -> tuple[float, float]:
    from scipy.special import ndtr, stdtrit

    tail = float(ndtr(-np.sqrt(scenes / (scenes - 1)) * stdtrit(scenes - 1, (1 + LEVEL) / 2)))
    return tail, 1 - tail
