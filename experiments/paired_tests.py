r"""Paired tests over scenes, and their correction for a family.

The null hypothesis of the paired test is that two attacks are exchangeable: the difference in each scene then has
either sign with equal probability (Fisher 1935; Efron and Tibshirani 1993, §15). Seeds of a scene change their sign
together.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gspure.arrays import Float64
from gspure.metrics.statistics import SEED, in_order, means_of

DRAWS: Final = 2**16  # combinations of signs: up to 16 scenes all of them, for more scenes as many random ones
DIGITS: Final = 10  # significant digits compared of the largest difference: further ones may be rounding error


def paired_test(differences: Sequence[ArrayLike]) -> float:
    """Return the p-value of a sign-flip test: whether the differences of the seeds of every scene are centred at 0.

    It is two-sided: the share of random signs of scenes whose mean is at least as far from 0. It is exact up to 16
    scenes. For more it is estimated; the observed signs count as one of the draws, so it is never 0 (Phipson and Smyth
    2010).
    """
    from scipy.stats import permutation_test

    means = means_of(in_order(differences))
    if len(means) == 1 or not means.any():  # scipy requires two means; one is as far from 0 with either sign
        return 1.0
    # Whole numbers of DIGITS decimal digits have exact sums, so means that tie on a decimal grid tie here, too.
    exponent = max(math.floor(math.log10(np.abs(means).max())), -200)
    whole = np.rint(means * 10.0 ** (DIGITS - 1 - exponent))
    rng = np.random.default_rng(SEED)
    settings = {"permutation_type": "samples", "n_resamples": DRAWS, "random_state": rng}
    test = permutation_test((whole,), np.mean, vectorized=True, batch=4096, **settings)
    return float(test.pvalue)


def holm(p: ArrayLike) -> Float64:
    r"""Return p-values [m], in the order of `p`, corrected for a family of tests.

    .. math:: \tilde p_{(i)} = \max_{j \le i} \min\left(1, (m - j + 1)\, p_{(j)}\right)

    (Holm 1979.) The significance level bounds the probability of any false rejection, however the tests depend on each
    other.
    """
    values = np.asarray(p, np.float64)
    order = np.argsort(values, kind="stable")
    steps = values[order] * np.arange(len(values), 0, -1)
    adjusted = np.empty_like(values)
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return adjusted
