"""The minimum spanning tree by hdbscan, for devices without double precision and as the reference of tests."""

from typing import Any

import numpy as np

from gspure.files import Float64, Indices

_LEAF_SIZE = 13  # hdbscan's default, 40 // 3


def minimum_spanning_tree(points: Float64, copies: Indices, min_samples: int) -> tuple[Indices, Float64, Float64]:
    """Return the tree of `gspure.opencl.spanning.minimum_spanning_tree`, by hdbscan's exact dual-tree Boruvka."""
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

    def __init__(self, points: Float64, copies: Indices, min_samples: int) -> None:
        from scipy.spatial import cKDTree

        self.data = points
        self.count = min(min_samples + 1, len(points))
        tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
        self._distances, self._rows = tree.query(points, k=self.count)
        is_core = np.cumsum(copies[self._rows], axis=1) > min_samples
        core = is_core.argmax(axis=1)
        self.core_distances = self._distances[np.arange(len(points)), core]
        # hdbscan reads the last distance as the core distance, and assumes that all neighbours are within it.
        self._distances[:, -1] = self.core_distances
        beyond = np.arange(self.count) > core[:, None]
        self._rows[beyond] = np.nonzero(beyond)[0]

    def query(self, _points: Any, k: int, **_: bool) -> tuple[Float64, Indices]:
        """Return distances and rows [U,k] of the nearest points, each point itself included."""
        return self._distances[:, :k], self._rows[:, :k]
