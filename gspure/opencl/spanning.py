"""HDBSCAN on the device: the spanning tree by Boruvka's algorithm (spanning.cl), the hierarchy (hierarchy.cl)."""

from typing import Any, NamedTuple

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.arrays import Float64, Indices, UInt32
from gspure.constants import LEAF
from gspure.opencl.engine import Engine

_NONE = 0xFFFFFFFF


class _Search:
    """Points on the device, in the order of a k-d tree."""

    def __init__(self, engine: Engine, points: Float64, copies: NDArray[Any], min_samples: int) -> None:
        self.count, columns = points.shape
        self.levels = max(0, int(np.ceil(np.log2(self.count / LEAF))))
        self.leaves = 1 << self.levels
        self._engine = engine
        self._shape = (self.count, self.levels)
        fits_float32 = np.array_equal(points, points.astype(np.float32))
        self._real = 4 if fits_float32 else 8  # bytes of a coordinate in the search
        defines = {"COLUMNS": columns, "NEIGHBOURS": min_samples, "SINGLES": int(fits_float32)}
        self._launch = engine.program("spanning", **defines).launch
        self._build(points)
        self._find_cores(copies, min_samples)

    def _build(self, points: Float64) -> None:
        engine = self._engine
        columns = points.shape[1]
        self._points = engine.uploaded(points)
        self._order = engine.uploaded(np.arange(self.count, dtype=np.uint32))
        keys = engine.allocate(8 * self.count)
        for level in range(self.levels):
            self._launch("split_nodes", 1 << level, *self._shape, level, self._points, self._order, keys)
        blocks = engine.allocate(8 * self.leaves * columns * LEAF)
        searched = engine.allocate(self._real * self.leaves * columns * LEAF)
        boxes = engine.allocate(self._real * 2 * self.leaves * 2 * columns)
        self._places = (blocks, searched, boxes)
        self._launch("fill_leaves", self.leaves, *self._shape, self._points, self._order, *self._places)
        self._join("join_boxes", boxes)
        self.order = engine.read(self._order, (self.count,), np.uint32)

    def _find_cores(self, copies: NDArray[Any], min_samples: int) -> None:
        engine = self._engine
        self._neighbours = engine.allocate(4 * self.count * min_samples)
        self._core = engine.allocate(8 * self.count)
        self._launch(
            "find_neighbours",
            self.leaves,
            *self._shape,
            min_samples,
            *self._places,
            engine.uploaded(copies[self.order].astype(np.uint32)),
            self._neighbours,
            self._core,
        )
        self._cores = engine.allocate(self._real * self.leaves * LEAF)
        self._least_cores = engine.allocate(self._real * 2 * self.leaves)
        self._launch("fill_cores", self.leaves, *self._shape, self._core, self._cores, self._least_cores)
        self._join("join_cores", self._least_cores)
        self.core = engine.read(self._core, (self.count,), np.float64)
        # The state of the points between Boruvka's rounds.
        self._component = engine.allocate(4 * self.count)
        self._components = engine.allocate(4 * self.leaves * LEAF)
        self._node_components = engine.allocate(4 * 2 * self.leaves)
        self._partners = engine.uploaded(np.full(self.count, _NONE, np.uint32))
        self._lengths = engine.uploaded(np.full(self.count, np.inf))
        self._least_lengths = engine.uploaded(self.core)

    def edges(self, component: UInt32, component_count: int) -> tuple[UInt32, UInt32, Float64]:
        """Return (points, partners, squared lengths) of the shortest edge that leaves each component.

        `component` [U] is the component of each point, in the order of the tree.
        """
        engine = self._engine
        engine.copied(component, self._component)
        outputs = (self._components, self._node_components)
        self._launch("fill_components", self.leaves, *self._shape, self._component, *outputs)
        self._join("join_components", self._node_components)
        unbounded = np.full(component_count, np.inf, np.float32)
        bounds = engine.uploaded(unbounded)
        shortest = engine.uploaded(unbounded)
        self._launch(
            "offer_edges",
            self.count,
            self.count,
            self._points,
            self._order,
            self._neighbours,
            self._core,
            self._component,
            self._partners,
            self._lengths,
            bounds,
        )
        self._launch(
            "find_edges",
            self.leaves,
            *self._shape,
            *self._places,
            self._core,
            self._cores,
            self._least_cores,
            self._components,
            self._node_components,
            bounds,
            self._partners,
            self._lengths,
            self._least_lengths,
            shortest,
        )
        lengths = engine.read(self._lengths, (self.count,), np.float64)
        partners = engine.read(self._partners, (self.count,), np.uint32)
        least = engine.read(shortest, (component_count,), np.float32)
        if component_count == self.count:  # each point is a component
            return np.arange(self.count, dtype=np.uint32), partners, lengths
        points = np.flatnonzero(lengths <= least[component]).astype(np.uint32)
        points = points[np.argsort(lengths[points], kind="stable")][::-1]
        first = np.empty(component_count, np.uint32)
        first[component[points]] = points  # the last write wins: the shortest edge, the first of equal ones
        return first, partners[first], lengths[first]

    def _join(self, name: str, values: cl.Buffer) -> None:
        for level in reversed(range(self.levels)):
            self._launch(name, 1 << level, level, values)


def minimum_spanning_tree(
    engine: Engine, points: Float64, copies: NDArray[Any], min_samples: int
) -> tuple[Indices, Float64, Float64]:
    """Return the minimum spanning tree of distinct points under the mutual reachability distance.

    Each of the two or more `points` [U,C] stands for `copies` [U] coincident points. `min_samples` counts other points
    and is less than the sum of `copies`. Return the edges [U-1,2], the lower point first, their lengths [U-1], and the
    core distances [U].
    """
    search = _Search(engine, points, copies, min_samples)
    component = np.arange(search.count, dtype=np.uint32)
    component_count = search.count
    ends = []
    squares = []
    while component_count > 1:
        near, far, squared_lengths = search.edges(component, component_count)
        kept, component_count, joined_component = _join(component[far])
        ends.append(np.column_stack([near[kept], far[kept]]))
        squares.append(squared_lengths[kept])
        component = joined_component[component]
    core = np.empty(search.count)
    core[search.order] = search.core
    a, b = search.order[np.concatenate(ends)].T
    edges = np.column_stack([np.minimum(a, b), np.maximum(a, b)])
    return edges, np.sqrt(np.concatenate(squares)), np.sqrt(core)


def _join(targets: UInt32) -> tuple[Indices, int, UInt32]:
    """Join each component to its target, without cycles.

    From each component, the targets lead to a cycle: usually of two components that are each other's target, otherwise
    of several with edges of equal length. The edge of the highest component of a cycle is left out. Return the
    components whose edges join the tree, the number of new components, and the new component of each old one.
    """
    components = np.arange(len(targets), dtype=np.uint32)
    highest = components  # of the next 2^n components
    ahead = targets  # the component after these
    for _ in range(len(targets).bit_length()):
        before = ahead
        highest = np.maximum(highest, highest[ahead])
        ahead = ahead[ahead]
        if np.array_equal(before, ahead):
            break
    ends = highest[ahead]
    lowest = np.empty_like(components)
    lowest[ends[::-1]] = components[::-1]  # the last write wins
    firsts = lowest[ends]
    numbers = np.cumsum(firsts == components, dtype=np.uint32) - np.uint32(1)
    kept = np.flatnonzero(ends != components)
    return kept, len(components) - len(kept), numbers[firsts]


class Condensed(NamedTuple):
    """Clusters within clusters, numbered so that children come before parents and the root is last.

    `parents` [C-1] and `parent_levels` [C-1]: the parent of each cluster but the root, and the level that joins them.
    `joined` [K]: the points, sorted by the level at which they join a cluster. `point_clusters` [K] and `point_levels`
    [K]: that cluster and that level of each point.
    """

    parents: UInt32
    parent_levels: UInt32
    joined: UInt32
    point_clusters: UInt32
    point_levels: UInt32


def condense(engine: Engine, edges: NDArray[Any], level_starts: NDArray[Any], min_cluster_size: int) -> Condensed:
    """Return the hierarchy of all components of at least `min_cluster_size` points, 2 or more.

    `edges` [K-1,2] are a spanning tree of K >= `min_cluster_size` points; `level_starts` [L+1] are the first edge of
    each level, and K - 1.
    """
    count = len(edges) + 1
    most_clusters = 2 * (count // min_cluster_size)
    state = [engine.allocate(4 * count) for _ in range(7)]
    points = [engine.allocate(4 * count) for _ in range(3)]
    clusters = [engine.allocate(4 * most_clusters) for _ in range(2)]
    cluster_count = engine.allocate(4)
    engine.program("hierarchy").launch(
        "condense",
        1,
        count,
        len(level_starts) - 1,
        min_cluster_size,
        engine.uploaded(edges.astype(np.uint32)),
        engine.uploaded(level_starts.astype(np.uint32)),
        *state,
        *points,
        *clusters,
        cluster_count,
        group=1,
    )
    (inner,) = engine.read(cluster_count, (1,), np.uint32) - 1
    return Condensed(
        *(engine.read(buffer, (int(inner),), np.uint32) for buffer in clusters),
        *(engine.read(buffer, (count,), np.uint32) for buffer in points),
    )
