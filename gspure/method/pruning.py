"""Adaptive pruning: of clusters as a whole, and of noise points one by one."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools, Float64
from gspure.constants import NOISE_LABEL, TAU_C, TAU_N
from gspure.errors import InputError


def mean_weight(weights: NDArray[Any]) -> float:
    r"""Return the global average weight.

    .. math:: \bar\omega = \frac{1}{K} \sum_{i=1}^{K} \omega_i

    `weights` [K] are summed in ascending order, so the order of rows has no effect. Without rows, the mean is 0.
    """
    return float(np.mean(np.sort(weights), dtype=np.float64)) if len(weights) else 0.0


def cluster_weights(labels: NDArray[Any], weights: NDArray[Any]) -> Float64:
    r"""Return the mean weight of every cluster: float64 [M].

    .. math:: \tilde\Omega(C_i) = \frac{1}{|C_i|} \sum_{k \in C_i} \omega_k

    (paper, §Geometrically Accurate Feature Clustering.) Labels [K] are clusters 0 .. M-1, none of them empty, or -1 for
    noise.
    """
    ascending = np.argsort(weights)
    clustered = ascending[labels[ascending] != NOISE_LABEL]
    total = np.bincount(labels[clustered], weights=np.asarray(weights, np.float64)[clustered])
    return total / np.bincount(labels[clustered])


def deciding_weights(labels: NDArray[Any], weights: NDArray[Any]) -> Float64:
    """Return the weight that decides on each Gaussian: the mean of its cluster, or its own if it is noise.

    (paper, §Adaptive Pruning.)
    """
    deciding = np.array(weights, np.float64)
    clustered = labels != NOISE_LABEL
    deciding[clustered] = cluster_weights(labels, weights)[labels[clustered]]
    return deciding


def prune_mask(labels: NDArray[Any], weights: NDArray[Any], tau_c: float = TAU_C, tau_n: float = TAU_N) -> Bools:
    r"""Return the prune mask [K] of adaptive pruning, for labels and weights [K].

    .. math::
        \mathrm{Prune}(G_k) = \begin{cases}
        \mathbb{I}(\tilde\Omega(C_i) < \bar\omega / \tau_c) & G_k \in C_i \\
        \mathbb{I}(\omega_k < \bar\omega / \tau_n) & G_k \in \mathcal{N}
        \end{cases}

    (paper, §Adaptive Pruning.) The cluster and noise pruning factors are above 0; larger ones prune less.
    """
    mean = mean_weight(np.asarray(weights, np.float64))
    cluster_threshold = mean / _factor("tau_c", tau_c)
    noise_threshold = mean / _factor("tau_n", tau_n)
    thresholds = np.where(labels != NOISE_LABEL, cluster_threshold, noise_threshold)
    return deciding_weights(labels, weights) < thresholds


def plain_prune_mask(weights: NDArray[Any], tau: float = TAU_N) -> Bools:
    r"""Return the prune mask [K] without clustering, for weights [K] and a factor above 0.

    .. math:: \mathbb{I}(\omega_k < \bar\omega / \tau)
    """
    return np.asarray(weights, np.float64) < mean_weight(weights) / _factor("tau", tau)


def _factor(name: str, tau: float) -> float:
    if not (np.isfinite(tau) and tau > 0):
        raise InputError("pruning", name, expected="a number above 0", found=repr(tau))
    return tau
