"""HDBSCAN's condensed hierarchy (hierarchy.cl)."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.files import UInt32
from gspure.opencl.engine import Engine


class Condensed(NamedTuple):
    """Clusters within clusters, numbered so that children come before parents and the root is last.

    `parents` [C-1] and `parent_levels` [C-1]: the parent of each cluster but the root, and the level that joins them.
    `joined` [K]: the points by the level at which they join a cluster; `point_clusters` [K] and `point_levels` [K] name
    that cluster and that level.
    """

    parents: UInt32
    parent_levels: UInt32
    joined: UInt32
    point_clusters: UInt32
    point_levels: UInt32


def condense(engine: Engine, edges: NDArray[Any], level_starts: NDArray[Any], min_cluster_size: int) -> Condensed:
    """Return the hierarchy of all components of at least `min_cluster_size` points, 2 or more.

    `edges` [K-1,2] are a spanning tree of at least as many points; `level_starts` [L+1] are the first edge of each
    level, and K - 1.
    """
    count = len(edges) + 1
    most = 2 * (count // min_cluster_size)
    state = [engine.allocate(4 * count) for _ in range(7)]
    points = [engine.allocate(4 * count) for _ in range(3)]
    clusters = [engine.allocate(4 * most) for _ in range(2)]
    cluster_count = engine.allocate(4)
    engine.program("hierarchy").launch(
        "condense",
        1,
        *(count, len(level_starts) - 1, min_cluster_size),
        *(engine.uploaded(edges.astype(np.uint32)), engine.uploaded(level_starts.astype(np.uint32))),
        *(*state, *points, *clusters, cluster_count),
        group=1,
    )
    (inner,) = engine.read(cluster_count, (1,), np.uint32) - 1
    return Condensed(
        *(engine.read(buffer, (int(inner),), np.uint32) for buffer in clusters),
        *(engine.read(buffer, (count,), np.uint32) for buffer in points),
    )
