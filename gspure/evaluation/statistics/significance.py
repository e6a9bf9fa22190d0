r"""Paired tests of two attacks over scenes, and the correction for many of them.

Under the null hypothesis that the two attacks are exchangeable, the difference in each scene has either sign with equal
probability (Fisher 1935; Efron and Tibshirani 1993, §15). Seeds of one scene share that scene, so they change their
sign together; flipping them one by one would count repetitions as evidence.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gspure.dtypes import Float64
from gspure.evaluation.statistics.cells import checked

DRAWS: Final = 2**16
"""Ours. Up to 16 scenes this is every combination of signs; for more scenes, as many are drawn."""

SEED: Final = 0


class PairedTest(NamedTuple):
    """The outcome of a paired comparison."""

    difference: float
    """The mean of the scenes' mean differences."""

    p: float
    """Two-sided: share of random signs whose mean is at least as far from 0."""

    smallest_p: float
    """The smallest `p` possible: with few scenes no difference is significant, however large."""

    scenes: int


def paired_test(differences: Sequence[ArrayLike]) -> PairedTest:
    """Test whether the differences of the seeds of every scene are centred at 0, by flipping the signs of scenes.

    `p` is exact up to 16 scenes. For more it is estimated; the observed signs count as one of the draws, so `p` is
    never 0 (Phipson and Smyth 2010). Raise `InputError` if there is no value, or one is not finite.
    """
    means = np.array([group.mean() for group in checked(differences)])
    scenes = len(means)
    smallest = max(2.0 ** (1 - scenes), 2 / (DRAWS + 1))
    return PairedTest(float(means.mean()), _sign_flip_p(means), smallest, scenes)


def _sign_flip_p(means: Float64) -> float:
    from scipy.stats import permutation_test

    if len(means) == 1:  # scipy requires two; a single one is as far from 0 with either sign
        return 1.0
    flips = {"permutation_type": "samples", "n_resamples": DRAWS, "random_state": np.random.default_rng(SEED)}
    return float(permutation_test((means,), np.mean, vectorized=True, batch=4096, **flips).pvalue)


def holm(p: ArrayLike) -> Float64:
    r"""Return p-values corrected for a family of tests, so that the level bounds the chance of any false rejection.

    .. math:: \tilde p_{(i)} = \max_{j \le i} \min\left(1, (m - j + 1)\, p_{(j)}\right)

    (Holm 1979.) It assumes nothing about the dependence of the tests.
    The order of `p` [m] is kept.
    """
    values = np.asarray(p, np.float64)
    order = np.argsort(values, kind="stable")
    steps = values[order] * np.arange(len(values), 0, -1)
    adjusted = np.empty_like(values)
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return adjusted
