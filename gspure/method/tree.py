"""The exact minimum spanning tree of mutual reachability: all of HDBSCAN that depends on the points."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64, Indices, load_array
from gspure.constants import MIN_SAMPLES
from gspure.errors import InputError
from gspure.progress import warn
from gspure.settings import NEIGHBOURS

if TYPE_CHECKING:
    from gspure.opencl.device import Device

Tree = Float64


def spanning_tree(features: NDArray[Any], min_samples: int = MIN_SAMPLES, *, device: Device | None = None) -> Tree:
    r"""Return the minimum spanning tree of the points under the mutual reachability distance.

    .. math:: d_{mreach}(a, b) = \max(\mathrm{core}(a), \mathrm{core}(b), \lVert a - b \rVert)

    where core(a) is the distance from a to its `min_samples`-th nearest other point (Campello et al. 2013; McInnes et
    al. 2017), or to the farthest, if there are fewer. The search treats coincident points as one; the tree connects
    them to the first of them.

    The tree [K-1,3] has edges (a, b, distance) with a < b, sorted by distance; edges of equal length by the
    lexicographic order of the points, so it does not depend on the order of rows. On a device without double
    precision, hdbscan computes the tree.

    Raise `InputError` if `min_samples` is not from 1 to 128, there is no point, or a feature is not finite.
    """
    points = np.asarray(features, np.float64)
    NEIGHBOURS.require("clustering", "min_samples", min_samples)
    min_samples = int(min_samples)  # the device gets no integers of numpy
    if not np.isfinite(points).all():
        raise InputError("clustering", "features", expected="finite values", found="NaN or infinity")
    if not len(points):
        raise InputError("clustering", "features", expected="at least one Gaussian", found="none")
    if min_samples > len(points) > 1:
        warn(f"clustering: min_samples is {min_samples}, more than the {len(points)} rows; all of them are used")
    rows = _order(*points.T)
    points = points[rows]
    is_first = np.append(True, (points[1:] != points[:-1]).any(axis=1))
    firsts = np.flatnonzero(is_first)
    piles = np.cumsum(is_first) - 1
    neighbours = min(min_samples, len(points) - 1)
    ends, distances, core_distances = _tree_of_distinct(points[firsts], np.bincount(piles), neighbours, device)
    surplus = np.flatnonzero(~is_first)
    pairs = np.concatenate([firsts[ends], np.column_stack([firsts[piles[surplus]], surplus])])
    distances = np.append(distances, core_distances[piles[surplus]])
    order = _order(distances, pairs[:, 0] * len(points) + pairs[:, 1])
    a, b = rows[pairs[order]].T
    return np.column_stack([np.minimum(a, b), np.maximum(a, b), distances[order]])


def _order(*keys: NDArray[Any]) -> Indices:
    """Return the lexicographic order of rows by `keys` [K]; with few ties, numpy's lexsort is slower."""
    order = np.argsort(keys[0], kind="stable")
    tied = np.zeros(len(order), np.bool_)
    equal = ~(np.diff(keys[0][order]) > 0)
    tied[1:] |= equal
    tied[:-1] |= equal
    rows = order[tied]
    order[tied] = rows[np.lexsort([key[rows] for key in reversed(keys)])]
    return order


def _tree_of_distinct(
    points: Float64, copies: Indices, min_samples: int, device: Device | None
) -> tuple[Indices, Float64, Float64]:
    """Return the tree of `gspure.opencl.spanning.minimum_spanning_tree`; also of a single point."""
    if len(points) == 1:
        return np.zeros((0, 2), np.intp), np.zeros(0), np.zeros(1)

    from gspure.opencl import spanning
    from gspure.opencl.device import choose_device
    from gspure.opencl.engine import Engine

    _, exponent = np.frexp(np.abs(points).max())
    points = np.ldexp(points, -exponent)  # exact, and squares neither overflow nor underflow
    engine = Engine((device or choose_device()).cl_device)
    if engine.device.double_fp_config:
        ends, distances, core_distances = spanning.minimum_spanning_tree(engine, points, copies, min_samples)
    else:
        ends, distances, core_distances = hdbscan_tree(points, copies, min_samples)
    return ends, np.ldexp(distances, exponent), np.ldexp(core_distances, exponent)


def hdbscan_tree(points: Float64, copies: Indices, min_samples: int) -> tuple[Indices, Float64, Float64]:
    """Return the tree of `gspure.opencl.spanning.minimum_spanning_tree` by hdbscan's exact dual-tree Boruvka."""
    from hdbscan import HDBSCAN
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import minimum_spanning_tree
    from scipy.spatial import cKDTree

    owners = np.repeat(np.arange(len(points)), copies)
    every = points[owners]
    core_distances = cKDTree(every).query(points, k=[min_samples + 1])[0][:, 0]
    search = HDBSCAN(
        min_samples=min_samples,
        algorithm="boruvka_kdtree",
        approx_min_span_tree=False,
        gen_min_span_tree=True,
        core_dist_n_jobs=1,
    )
    edges = search.fit(every).minimum_spanning_tree_.to_numpy()
    edges = edges[np.argsort(edges[:, 2], kind="stable")]
    ends = np.sort(owners[edges[:, :2].astype(np.intp)], axis=1)
    _, shortest = np.unique(ends, axis=0, return_index=True)  # copies of a point may be linked by way of other points
    shortest = shortest[ends[shortest, 0] < ends[shortest, 1]]
    graph = coo_array((edges[shortest, 2], tuple(ends[shortest].T)), shape=(len(points), len(points)))
    tree = minimum_spanning_tree(graph).tocoo()
    return np.column_stack([tree.row, tree.col]).astype(np.intp), tree.data, core_distances


def read_tree(path: Path) -> Tree:
    """Read a spanning tree [K-1,3], or raise `InputError` unless 0 <= a < b < K and the distances ascend from 0."""
    tree = load_array(path, dtype=np.float64, shape=(None, 3), least=0)
    a, b, distances = tree.T
    is_valid = (a < b) & (b <= len(tree)) & (np.trunc(tree[:, :2]) == tree[:, :2]).all(axis=1)
    is_valid &= np.diff(distances, prepend=0) >= 0
    if not is_valid.all():
        row = int(is_valid.argmin())
        expected = f"0 <= a < b <= {len(tree)}, ascending distances"
        raise InputError(path, f"edge {row}", expected=expected, found=" ".join(map(str, tree[row])))
    return tree


def coincident_points(tree: Tree) -> int:
    """Return the number of edges of length zero: the surplus points of piles of more than `min_samples` equal points.

    Such a pile is infinitely dense for HDBSCAN (λ = 1 / 0): it becomes a cluster if it has `min_cluster_size` points.
    """
    return int(np.count_nonzero(tree[:, 2] == 0))
