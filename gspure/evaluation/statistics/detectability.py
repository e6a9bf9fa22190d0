r"""Detectability: how well the extracted message separates attacked models from negative controls.

The statistic is any number that grows with the quality of the extracted message, such as its PSNR. The
area under its ROC curve (AUC) is the probability that an attacked model exceeds a negative control,

.. math:: \theta = P(X > Y) + \tfrac{1}{2} P(X = Y)

(Mann and Whitney 1947; Hanley and McNeil 1982): 1 if the two never overlap, 1/2 if the message cannot be detected.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gspure.evaluation.statistics.intervals import LEVEL


class Detectability(NamedTuple):
    """An area under the ROC curve, with its interval at `gspure.evaluation.statistics.LEVEL`."""

    auc: float
    low: float
    high: float
    assets: int
    """Number of attacked models."""

    controls: int


def detectability(assets: ArrayLike, controls: ArrayLike) -> Detectability:
    r"""Return how well a statistic separates attacked models from negative controls.

    `assets` [m] and `controls` [n] hold one value each; they must be independent, so not one per view. Infinities are
    permitted.

    The interval holds every :math:`\theta` that the data does not reject, by the variance of Hanley and McNeil with
    both counts replaced by their mean,

    .. math::
        \frac{\theta (1 - \theta)}{mn} \left[ 1 + N \frac{1 - \theta}{2 - \theta} + N \frac{\theta}{1 + \theta} \right],
        \quad N = \frac{m + n}{2} - 1

    (Newcombe 2006, method 5). Unlike a Wald interval, it does not shrink to a point if every model exceeds every
    control: for three against three it is 0.50 to 1.
    """
    x, y = np.ravel(assets), np.ravel(controls)
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
