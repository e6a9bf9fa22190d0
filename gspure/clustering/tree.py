"""The exact minimum spanning tree of mutual reachability: all of HDBSCAN that depends on the points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.constants import MIN_SAMPLES
from gspure.errors import InputError

Tree = NDArray[np.float64]

_LEAF_SIZE = 13  # hdbscan's own choice, 40 // 3


def spanning_tree(features: NDArray[Any], min_samples: int = MIN_SAMPLES) -> Tree:
    r"""Return the minimum spanning tree of the points under the mutual reachability distance.

    .. math:: d_{mreach}(a, b) = \max(\mathrm{core}(a), \mathrm{core}(b), \lVert a - b \rVert)

    where core(a) is the distance from a to its `min_samples`-th nearest other point (Campello et al. 2013; McInnes et
    al. 2017). Points that coincide are one point of the search, and hang on the first of them in the tree. The
    computation knows points by their place in lexicographic order, so the tree does not depend on the order of rows.

    Parameters
    ----------
    features : array [K,C]
        Finite values.
    min_samples : int
        At least 1; taken as K - 1 where there are fewer other points.

    Returns
    -------
    array [K-1,3], float64
        Edges (a, b, distance) with a < b, sorted by distance; equal distances by the lexicographic order of the points.

    Raises
    ------
    InputError
        If `min_samples` is below 1, there is no point, or a feature is not finite.

    """
    points = np.asarray(features, np.float64)
    if min_samples < 1:
        raise InputError("clustering", "min_samples", expected="at least 1", found=str(min_samples))
    if not np.isfinite(points).all():
        raise InputError("clustering", "features", expected="finite values", found="NaN or infinity")
    if not len(points):
        raise InputError("clustering", "features", expected="at least one Gaussian", found="none")
    rows = np.lexsort(points.T[::-1])
    points = points[rows]
    is_first = np.append(True, (points[1:] != points[:-1]).any(axis=1))
    firsts = np.flatnonzero(is_first)
    piles = np.cumsum(is_first) - 1
    ends, distances, core_distances = _search(points[firsts], np.bincount(piles), min(min_samples, len(points) - 1))
    others = np.flatnonzero(~is_first)
    pairs = np.concatenate([firsts[ends], np.column_stack([firsts[piles[others]], others])])
    distances = np.append(distances, core_distances[piles[others]])
    order = np.lexsort([pairs[:, 1], pairs[:, 0], distances])
    return np.column_stack([np.sort(rows[pairs[order]], axis=1), distances[order]])


def _search(
    points: NDArray[np.float64], copies: NDArray[np.intp], min_samples: int
) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
    """Return the tree of distinct `points` [U,C], each of which stands for some `copies`.

    Returns
    -------
    ends : array [U-1,2], int
        The lower and the higher point of each edge.
    distances : array [U-1]
        Lengths of the edges.
    core_distances : array [U]

    """
    if len(points) == 1:
        return np.zeros((0, 2), np.intp), np.zeros(0), np.zeros(1)

    from hdbscan._hdbscan_boruvka import KDTreeBoruvkaAlgorithm

    neighbours = _Neighbours(points, copies, min_samples)
    edges = KDTreeBoruvkaAlgorithm(
        neighbours, neighbours.count - 1, leaf_size=_LEAF_SIZE, approx_min_span_tree=False, n_jobs=1
    ).spanning_tree()
    return np.sort(edges[:, :2].astype(np.intp), axis=1), edges[:, 2], neighbours.core_distances


class _Neighbours:
    """The nearest-neighbour query of `KDTreeBoruvkaAlgorithm`, answered by scipy's k-d tree.

    scikit-learn's k-d tree, which hdbscan would pass, takes at least six times as long for the same distances.
    """

    def __init__(self, points: NDArray[np.float64], copies: NDArray[np.intp], min_samples: int) -> None:
        from scipy.spatial import cKDTree

        self.data = points
        self.count = min(min_samples + 1, len(points))
        tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
        self._distances, self._rows = tree.query(points, k=self.count)
        is_core = np.cumsum(copies[self._rows], axis=1) > min_samples
        core = is_core.argmax(axis=1)
        self.core_distances = self._distances[np.arange(len(points)), core]
        # hdbscan takes the last neighbour's distance for the core distance, and every neighbour as within it.
        self._distances[:, -1] = self.core_distances
        beyond = np.arange(self.count) > core[:, None]
        self._rows[beyond] = np.nonzero(beyond)[0]

    def query(self, _points: Any, k: int, **_: bool) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Return distances and rows [U,k] of the nearest points, each point itself included."""
        return self._distances[:, :k], self._rows[:, :k]


def coincident_points(tree: Tree) -> int:
    """Return the number of edges of length zero: of surplus points in piles of more than `min_samples` equal ones.

    Such a pile is infinitely dense for HDBSCAN (λ = 1 / 0), so that it becomes a cluster whatever surrounds it.
    """
    return int(np.count_nonzero(tree[:, 2] == 0))
