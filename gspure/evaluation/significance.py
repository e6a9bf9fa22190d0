r"""Paired tests of two attacks over scenes, the correction for many of them, and detectability.

Under the null hypothesis that the two attacks are exchangeable, the difference in each scene has either sign with equal
probability (Fisher 1935; Efron and Tibshirani 1993, §15). Seeds of one scene change their sign together.

Detectability is how well a statistic, such as the PSNR of the message, separates attacked models from negative
controls: the area under its ROC curve (AUC) is

.. math:: \theta = P(X > Y) + \tfrac{1}{2} P(X = Y)

(Mann and Whitney 1947; Hanley and McNeil 1982): 1 if the two never overlap, 1/2 if the message cannot be detected.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gspure.evaluation.intervals import LEVEL, in_order, means_of
from gspure.files import Float64

DRAWS: Final = 2**16  # up to 16 scenes this is every combination of signs; for more, as many are drawn
SEED: Final = 0
DIGITS: Final = 10  # decimal digits of the largest difference that are compared: the rest may be rounding error


class PairedTest(NamedTuple):
    """The outcome of a paired comparison."""

    p: float  # two-sided: share of random signs whose mean is at least as far from 0
    smallest_p: float  # the smallest `p` possible: with few scenes no difference is significant, however large


def paired_test(differences: Sequence[ArrayLike]) -> PairedTest:
    """Test whether the differences of the seeds of every scene are centred at 0, by flipping the signs of scenes.

    `p` is exact up to 16 scenes. For more it is estimated; the observed signs count as one of the draws, so `p` is
    never 0 (Phipson and Smyth 2010).
    """
    from scipy.stats import permutation_test

    means = means_of(in_order(differences))
    smallest = max(2.0 ** (1 - len(means)), 2 / (DRAWS + 1))
    if len(means) == 1 or not means.any():  # scipy requires two; a single one is as far from 0 with either sign
        return PairedTest(1.0, smallest)
    # Whole numbers of DIGITS decimal digits: their sums are exact, so signs that tie on a decimal grid tie here, too.
    exponent = max(math.floor(math.log10(np.abs(means).max())), -200)
    whole = np.rint(means * 10.0 ** (DIGITS - 1 - exponent))
    flips = {"permutation_type": "samples", "n_resamples": DRAWS, "random_state": np.random.default_rng(SEED)}
    return PairedTest(float(permutation_test((whole,), np.mean, vectorized=True, batch=4096, **flips).pvalue), smallest)


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


class Detectability(NamedTuple):
    """An area under the ROC curve, with its interval at `gspure.evaluation.intervals.LEVEL`."""

    auc: float
    low: float
    high: float
    attacked: int  # number of attacked models
    controls: int  # number of controls


def detectability(attacked: ArrayLike, controls: ArrayLike) -> Detectability:
    r"""Return how well a statistic separates attacked models from negative controls.

    `attacked` [m] and `controls` [n] hold one value each; they must be independent, so not one per view. Infinities are
    permitted.

    The interval holds every :math:`\theta` that the data does not reject, by the variance of Hanley and McNeil with
    both counts replaced by their mean,

    .. math::
        \frac{\theta (1 - \theta)}{mn} \left[ 1 + N \frac{1 - \theta}{2 - \theta} + N \frac{\theta}{1 + \theta} \right],
        \quad N = \frac{m + n}{2} - 1

    (Newcombe 2006, method 5). It does not shrink to a point if every model exceeds every control.
    """
    x, y = np.ravel(attacked), np.ravel(controls)
    wins = np.count_nonzero(x[:, None] > y)
    ties = np.count_nonzero(x[:, None] == y)
    auc = float(wins + ties / 2) / (len(x) * len(y))
    return Detectability(auc, _low(auc, len(x), len(y)), 1 - _low(1 - auc, len(x), len(y)), len(x), len(y))


def _low(auc: float, m: int, n: int) -> float:
    """Return the lower end of the interval; the upper one is its mirror image."""
    from scipy.optimize import brentq
    from scipy.special import ndtri

    z, pairs = float(ndtri((1 + LEVEL) / 2)), (m + n) / 2 - 1

    def excess(theta: float) -> float:
        spread = 1 + pairs * (1 - theta) / (2 - theta) + pairs * theta / (1 + theta)
        return auc - theta - z * math.sqrt(theta * (1 - theta) * spread / (m * n))

    highest = min(auc, 1 - 1e-12)  # at 1 the variance is 0: a spurious root
    return float(brentq(excess, 0.0, highest)) if auc > 0 else 0.0
