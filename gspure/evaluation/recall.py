"""Agreement of a decision or a clustering with a known truth per Gaussian."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.errors import InputError


class Recall(NamedTuple):
    """How well the pruned Gaussians are those of the message; NaN where there is nothing to divide by."""

    precision: float
    """Share of the pruned that belong to the message."""

    recall: float
    """Share of the message that is pruned."""


def recall(pruned: NDArray[np.bool_], truth: NDArray[np.bool_]) -> Recall:
    """Return precision and recall of a pruning.

    Parameters
    ----------
    pruned : array [K], bool
        True where the Gaussian was removed.
    truth : array [K], bool
        True where the Gaussian belongs to the message.

    Raises
    ------
    InputError
        If the two are not of the same model.

    """
    _check_same_length("truth", pruned, truth)
    hits = int(np.count_nonzero(pruned & truth))
    return Recall(_ratio(hits, int(pruned.sum())), _ratio(hits, int(truth.sum())))


def adjusted_rand_index(labels: NDArray[Any], truth: NDArray[Any]) -> float:
    r"""Return how far two partitions agree: 1 if they are the same, 0 on average for random ones.

    .. math::
        \frac{\sum_{ij} \binom{n_{ij}}{2} - E}
        {\frac{1}{2} \left[ \sum_i \binom{a_i}{2} + \sum_j \binom{b_j}{2} \right] - E},
        \quad E = \frac{\sum_i \binom{a_i}{2} \sum_j \binom{b_j}{2}}{\binom{n}{2}}

    (Hubert and Arabie 1985.) Noise counts as one more group.

    Parameters
    ----------
    labels, truth : array [K], int
        A group for every Gaussian.

    Raises
    ------
    InputError
        If the two are not of the same length.

    """
    _check_same_length("truth", labels, truth)
    _, rows = np.unique(labels, return_inverse=True)
    columns_of, columns = np.unique(truth, return_inverse=True)
    joint = _pairs(np.unique(rows * len(columns_of) + columns, return_counts=True)[1])
    ours, theirs = _pairs(np.bincount(rows)), _pairs(np.bincount(columns))
    every = len(labels) * (len(labels) - 1) / 2
    expected = ours * theirs / every if every else 0.0
    largest = (ours + theirs) / 2
    return (joint - expected) / (largest - expected) if largest != expected else 1.0


def _pairs(counts: NDArray[np.intp]) -> float:
    sizes = counts.astype(np.float64)
    return float(np.sum(sizes * (sizes - 1) / 2))


def _ratio(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")


def _check_same_length(name: str, ours: NDArray[Any], theirs: NDArray[Any]) -> None:
    if ours.shape != theirs.shape:
        raise InputError(name, "length", expected=f"{list(ours.shape)}", found=f"{list(theirs.shape)}")
