"""The exact minimum spanning tree of mutual reachability: all of HDBSCAN that depends on the points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.constants import MIN_SAMPLES
from gspure.errors import InputError

Tree = NDArray[np.float64]

_LEAF_SIZE = 13  # hdbscan's own choice, 40 // 3


class _CoreDistances:
    """The nearest-neighbour query that `KDTreeBoruvkaAlgorithm` asks of the tree given to it, by scipy's k-d tree.

    hdbscan would pass scikit-learn's k-d tree, whose dual-tree query takes nine tenths of all time at 1M points of
    heavy-tailed 5-D features. scipy's gives the same distances for a sixth of the work or less.
    """

    def __init__(self, points: NDArray[np.float64]) -> None:
        self.data = points

    def query(self, points: Any, k: int, **_: bool) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Return distances and rows [K,k] of the k nearest points, each point itself included."""
        from scipy.spatial import cKDTree

        tree = cKDTree(self.data, balanced_tree=False, compact_nodes=False)
        distances, rows = tree.query(np.asarray(points), k=k)
        return distances, rows


def spanning_tree(features: NDArray[Any], min_samples: int = MIN_SAMPLES) -> Tree:
    r"""Return the minimum spanning tree of the points under the mutual reachability distance.

    .. math:: d_{mreach}(a, b) = \max(\mathrm{core}(a), \mathrm{core}(b), \lVert a - b \rVert)

    where core(a) is the distance from a to its `min_samples`-th nearest other point (Campello et al. 2013; McInnes et
    al. 2017). Exact: hdbscan's dual-tree Boruvka with ``approx_min_span_tree=False``, on one thread.

    Parameters
    ----------
    features : array [K,C]
        Finite values.
    min_samples : int
        At least 1; taken as K - 1 where there are fewer other points.

    Returns
    -------
    array [K-1,3], float64
        Edges (a, b, distance) with a < b, sorted by distance, then a, then b.

    Raises
    ------
    InputError
        If `min_samples` is below 1, there is no point, or a feature is not finite.

    """
    points = np.ascontiguousarray(features, np.float64)
    if min_samples < 1:
        raise InputError("clustering", "min_samples", expected="at least 1", found=str(min_samples))
    if not np.isfinite(points).all():
        raise InputError("clustering", "features", expected="finite values", found="NaN or infinity")
    if not len(points):
        raise InputError("clustering", "features", expected="at least one Gaussian", found="none")
    if len(points) == 1:
        return np.zeros((0, 3))

    from hdbscan._hdbscan_boruvka import KDTreeBoruvkaAlgorithm

    edges: Tree = KDTreeBoruvkaAlgorithm(
        _CoreDistances(points),
        min(min_samples, len(points) - 1),
        leaf_size=_LEAF_SIZE,
        approx_min_span_tree=False,
        n_jobs=1,
    ).spanning_tree()
    edges[:, :2].sort(axis=1)
    return edges[np.lexsort(edges.T[[1, 0, 2]])]


def coincident_points(tree: Tree) -> int:
    """Return the number of edges of length zero: of surplus points in piles of more than `min_samples` equal ones.

    Such a pile is infinitely dense for HDBSCAN (λ = 1 / 0), so that it becomes a cluster whatever surrounds it.
    """
    return int(np.count_nonzero(tree[:, 2] == 0))
