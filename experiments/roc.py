r"""How well a statistic separates marked models from clean ones: the area under its ROC curve.

.. math:: \theta = P(X > Y) + \tfrac{1}{2} P(X = Y)

(Mann and Whitney 1947; Hanley and McNeil 1982): 1 if the two never overlap, 1/2 if they cannot be told apart.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gspure.metrics.statistics import LEVEL


class Detectability(NamedTuple):
    """An area under the ROC curve, with its interval at `LEVEL`."""

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
    x = np.ravel(attacked)
    y = np.ravel(controls)
    wins = np.count_nonzero(x[:, None] > y)
    ties = np.count_nonzero(x[:, None] == y)
    auc = float(wins + ties / 2) / (len(x) * len(y))
    low = _low(auc, len(x), len(y))
    high = 1 - _low(1 - auc, len(x), len(y))
    return Detectability(auc, low, high, len(x), len(y))


def _low(auc: float, m: int, n: int) -> float:
    """Return the lower end of the interval; the upper one is its mirror image."""
    from scipy.optimize import brentq
    from scipy.special import ndtri

    z = float(ndtri((1 + LEVEL) / 2))
    mean_count = (m + n) / 2 - 1  # N of `detectability`

    def excess(theta: float) -> float:
        spread = 1 + mean_count * (1 - theta) / (2 - theta) + mean_count * theta / (1 + theta)
        return auc - theta - z * math.sqrt(theta * (1 - theta) * spread / (m * n))

    highest = min(auc, 1 - 1e-12)  # at 1 the variance is 0: a spurious root
    return float(brentq(excess, 0.0, highest)) if auc > 0 else 0.0
