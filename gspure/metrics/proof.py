r"""Evidence that a model holds a message, a picture: its trace in an extraction, against everything that lacks it.

The *trace* of a message in the extracted views is the mean over views of the gradient correlation in colour, at half
size:

.. math:: T = \frac{1}{V} \sum_v \frac{\nabla x_v \cdot \nabla m_v}{|\nabla x_v| |\nabla m_v|}

where pixels are means of 2 x 2. The message is *proven* by

.. math:: p = \max(p_c, p_{clean}, p_{twins}),

the probability of such a trace if the model does not hold it. :math:`p_c` is the rank of T among the traces of N
candidates, other pictures of the message's kind in the same extraction. :math:`p_{clean}` compares T with the traces
of the message in models that never held it, and :math:`p_{twins}` in redrawn twins: the attacked model, whose carrier
columns are drawn again. Both are read in the same way, fitting included. So a key that shows the message in any model
proves nothing, and neither does a model that only descends from the owner's.
"""

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Float64
from gspure.images import is_blank
from gspure.metrics.image_metrics import halved

VIEWS: Final = 4  # most views whose traces are compared; ours
SIGNIFICANCE: Final = 0.001  # the largest p at which a message is proven, with enough candidates
COARSEST: Final = 0.05  # the largest p at which it is proven, with few candidates; ours


class Traces(NamedTuple):
    """The traces of one try to extract the message."""

    message: float
    candidates: Float64  # [N], in the same extraction
    clean: Float64  # [K], of the message in models that never held it
    twins: Float64  # [J], of the message in redrawn twins
    two_sided: bool = False  # whether an inverted message counts; only for keys that are not fitted to the message


class Proof(NamedTuple):
    """How strongly an extraction shows its message."""

    trace: float
    z: float  # standard score of the trace among those of the candidates; NaN with fewer than two
    p_candidates: float
    p_clean: float | None  # None if unknown, with fewer than two models
    p_twins: float | None
    candidates: int
    clean_models: int
    twins: int

    @property
    def p(self) -> float:
        """The largest of the known p-values."""
        return max(p for p in (self.p_candidates, self.p_clean, self.p_twins) if p is not None)

    @property
    def level(self) -> float:
        """The significance that these candidates can reach: `SIGNIFICANCE`, or 1 / (N + 1) if that is larger."""
        return max(SIGNIFICANCE, 1 / (self.candidates + 1))

    @property
    def is_proven(self) -> bool:
        """Whether p reaches the level, which must not exceed `COARSEST`."""
        return self.p <= self.level <= COARSEST


def compared_views(count: int) -> list[int]:
    """Return the numbers of at most `VIEWS` of a count of views, evenly spaced, from the first on."""
    shown = min(count, VIEWS)
    return [count * number // shown for number in range(shown)]


def trace(extractions: Sequence[Float32], messages: Sequence[Float32]) -> float:
    """Return the trace T of a message [H,W,3] per view in the extractions, -1 to 1; a blank view counts as 0."""
    message = np.stack([halved(picture) for picture in messages])
    return float(traces(extractions, message[None])[0])


def traces(extractions: Sequence[Float32], candidates: NDArray[Any]) -> Float64:
    """Return the traces [N] of candidates in the extractions [H,W,3], one per view.

    `candidates` [N,V,H/2,W/2,3] have half size. Memory and time are those of one pass over them.
    """
    shown = _gradients(np.stack([halved(image) for image in extractions]))
    shown[[is_blank(image) for image in extractions]] = 0.0
    shown /= _norms(shown)[:, None]
    correlations = np.empty(candidates.shape[:2])
    for row, pictures in enumerate(candidates):
        gradients = _gradients(pictures)
        correlations[row] = _dots(shown, gradients) / _norms(gradients)
    return np.asarray(correlations.mean(axis=1))


def rank_p(trace: float, candidate_traces: Float64) -> float:
    r"""Return the p-value of a trace by its rank among those of N candidates.

    .. math:: p_c = \frac{1 + \#\{T_i \ge T\}}{N + 1}

    It is exact for a picture that is drawn like the candidates, and 1 without any.
    """
    return float((1 + np.count_nonzero(candidate_traces >= trace)) / (len(candidate_traces) + 1))


def models_p(trace: float, model_traces: Float64, spread: float, *, two_sided: bool = False) -> float | None:
    r"""Return the p-value of a trace against those of the message in K models that never held it; None if unknown.

    .. math:: t = \frac{T - \bar T}{s \sqrt{1 + 1 / K}}

    has K - 1 degrees of freedom if T is one more reading of such a model. `s` is the standard deviation, at least
    `spread`, that of the candidates: equal models do not make any difference significant.

    The spread of models can be many times that of candidates. So `spread` adds no degrees of freedom: two or three
    models give a valid test that almost nothing passes: for p = 0.001, T must exceed the mean by 390 standard
    deviations with two models, by 26 with three, and by 5.1 with eight. None if K < 2, or if nothing varies.
    """
    from scipy.special import stdtr

    K = len(model_traces)
    if K < 2:
        return None
    s = max(float(np.std(model_traces, ddof=1)), spread)
    if not s:
        return None
    t = (trace - float(np.mean(model_traces))) / (s * math.sqrt(1 + 1 / K))
    return float(2 * stdtr(K - 1, -abs(t)) if two_sided else stdtr(K - 1, -t))


def standard_score(trace: float, others: Float64) -> float:
    """Return how many standard deviations a trace lies above the mean of others [N]; NaN if N < 2 or none varies."""
    spread = _spread(others)
    return float((trace - np.mean(others)) / spread) if spread else math.nan


def prove(attempt: Traces) -> Proof:
    """Return the proof that an extraction gives.

    An owner who tries several extractions, a declared list, has the best of their proofs. So a wrong claim passes at
    most at the nominal rate times their number.
    """
    strength = abs(attempt.message) if attempt.two_sided else attempt.message
    of_candidates = np.abs(attempt.candidates) if attempt.two_sided else attempt.candidates
    spread = _spread(attempt.candidates)
    return Proof(
        trace=attempt.message,
        z=standard_score(attempt.message, attempt.candidates),
        p_candidates=rank_p(strength, of_candidates),
        p_clean=models_p(attempt.message, attempt.clean, spread, two_sided=attempt.two_sided),
        p_twins=models_p(attempt.message, attempt.twins, spread, two_sided=attempt.two_sided),
        candidates=len(attempt.candidates),
        clean_models=len(attempt.clean),
        twins=len(attempt.twins),
    )


def _spread(values: Float64) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else 0.0


def _gradients(pictures: NDArray[Any]) -> Float32:
    """Return the forward differences [V,D], down and across, of pictures [V,H,W,3] in any unit."""
    pixels = pictures.astype(np.float32)
    parts = [np.diff(pixels, axis=axis).reshape(len(pixels), -1) for axis in (1, 2)]
    return np.concatenate(parts, axis=1)


def _norms(gradients: Float32) -> Float32:
    """Return the norms [V] of rows; 1 for rows of zeros, which stay zeros."""
    norms = np.sqrt(_dots(gradients, gradients))
    return np.where(norms > 0, norms, np.float32(1))


def _dots(a: Float32, b: Float32) -> Float32:
    """Return the dot products [V] of rows; pairwise sums are accurate, and the same for any number of threads."""
    return np.asarray(np.sum(a * b, axis=1))
