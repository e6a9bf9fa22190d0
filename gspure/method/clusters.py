"""Flat clusters from a spanning tree (condensed hierarchy, stability, selection), and their file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, get_args

import numpy as np

from gspure.arrays import Bools, Float64, Indices, Int32, load_array, load_arrays, save_arrays
from gspure.constants import MAX_CLUSTER_SHARE, MIN_CLUSTER_SIZE, NOISE_LABEL
from gspure.errors import InputError
from gspure.settings import CLUSTER_SIZE

if TYPE_CHECKING:
    from gspure.opencl.device import Device
    from gspure.opencl.spanning import Condensed

Labels = Int32
Selection = Literal["eom_capped", "eom", "leaf"]
SELECTIONS: Final[tuple[Selection, ...]] = get_args(Selection)


def select(
    tree: Float64,
    min_cluster_size: int = MIN_CLUSTER_SIZE,
    selection: Selection = "eom_capped",
    max_cluster_share: float = MAX_CLUSTER_SHARE,
    *,
    device: Device | None = None,
) -> Labels:
    r"""Return the flat clustering :math:`\mathcal{C} = \{C_1, ..., C_M\} \cup \mathcal{N}` of a spanning tree.

    (paper, §Geometrically Accurate Feature Clustering; Campello et al. 2013.) A label is the cluster of a point, or -1
    for noise; clusters are numbered 0 .. M-1 in the order in which they form as the distance grows. `tree` [K-1,3] has
    edges (a, b, distance), sorted by distance: see `spanning_tree`. Edges of equal length join at once, so every
    minimum spanning tree of the same points gives the same clusters. A cluster has at least `min_cluster_size` points,
    2 or more; among fewer than twice as many points, there is no split, and all points are noise.

    The paper names neither parameters nor selection. ``eom`` is excess of mass, HDBSCAN's default, which often keeps
    most of a scene as one cluster; ``leaf`` takes the finest clusters; ``eom_capped`` splits clusters above
    `max_cluster_share` of the points, in (0, 1]; larger ones that cannot be split are noise. Twice `min_cluster_size`
    is always permitted, so that small models have clusters.

    Raise `InputError` if a setting is out of range.
    """
    CLUSTER_SIZE.require("clustering", "min_cluster_size", min_cluster_size)
    if selection not in SELECTIONS:
        raise InputError("clustering", "selection", expected=f"one of {', '.join(SELECTIONS)}", found=repr(selection))
    if not 0 < max_cluster_share <= 1:
        raise InputError("clustering", "max_cluster_share", expected="in (0, 1]", found=str(max_cluster_share))
    min_cluster_size = int(min_cluster_size)  # the device gets no integers of numpy
    count = len(tree) + 1
    if count < 2 * min_cluster_size:
        return np.full(count, NOISE_LABEL, np.int32)

    from gspure.opencl.device import choose_device
    from gspure.opencl.engine import Engine
    from gspure.opencl.spanning import condense

    level_starts = np.flatnonzero(np.diff(tree[:, 2], prepend=-1.0, append=np.inf))
    engine = Engine((device or choose_device()).cl_device)
    condensed = condense(engine, tree[:, :2], level_starts, min_cluster_size)
    with np.errstate(divide="ignore"):
        densities = 1.0 / tree[level_starts[:-1], 2]  # λ; infinite where more than min_samples points coincide
    if selection == "leaf":
        chosen = np.bincount(condensed.parents, minlength=len(condensed.parents) + 1) == 0  # without children
        chosen[-1] = False  # the root
    else:
        cap = count
        if selection == "eom_capped":
            cap = max(int(max_cluster_share * count), 2 * min_cluster_size)
        chosen = _excess_of_mass(condensed, densities, cap)
    return _labels(condensed, chosen)


def _excess_of_mass(condensed: Condensed, densities: Float64, cap: int) -> Bools:
    """Return the mask [C] of the chosen clusters: at most `cap` points, at least as stable as their descendants.

    The root is never chosen.
    """
    stabilities, sizes = _stabilities(condensed, densities)
    chosen = np.zeros(len(sizes), np.bool_)
    below = [0.0] * len(sizes)  # stability of the chosen descendants
    for cluster, (parent, stability, size) in enumerate(zip(condensed.parents, stabilities, sizes, strict=False)):
        chosen[cluster] = below[cluster] <= stability and size <= cap
        below[parent] += stability if chosen[cluster] else below[cluster]
    return chosen


def _stabilities(condensed: Condensed, densities: Float64) -> tuple[Float64, Indices]:
    """Return each cluster's stability, Σ (λ of a point's departure - λ of the cluster's birth), and its size."""
    count = len(condensed.parents) + 1
    births = np.append(densities[condensed.parent_levels], 0.0)
    clusters = condensed.point_clusters[condensed.joined]  # by level, so sums do not depend on the order of rows
    departures = densities[condensed.point_levels[condensed.joined]]
    stabilities = np.asarray(np.bincount(clusters, departures - births[clusters], count), np.float64)
    sizes = np.bincount(clusters, minlength=count)
    for cluster, parent in enumerate(condensed.parents):
        sizes[parent] += sizes[cluster]
        stabilities[parent] += sizes[cluster] * (births[cluster] - births[parent])
    return stabilities, sizes


def _labels(condensed: Condensed, chosen: Bools) -> Labels:
    """Return the label of each point: the number of the outermost chosen cluster that contains it, or noise."""
    owners = np.full(len(chosen) + 1, len(chosen))  # the last entry stands for noise
    for cluster in range(len(chosen) - 2, -1, -1):
        inherited = owners[condensed.parents[cluster]]
        owners[cluster] = cluster if chosen[cluster] and inherited == len(chosen) else inherited
    taken = np.unique(owners)[:-1]
    numbers = np.full(len(chosen) + 1, NOISE_LABEL, np.int32)
    numbers[taken] = np.arange(len(taken))
    return np.asarray(numbers[owners[condensed.point_clusters]])


def write_clusters(path: Path, labels: Labels, coincident: int, settings: Mapping[str, int | float | str]) -> None:
    """Write labels [K], the number of `gspure.method.tree.coincident_points` and the settings as .npz."""
    entries = {"labels": labels, "coincident": coincident, **settings}
    save_arrays(path, {name: np.asarray(value) for name, value in entries.items()})


def read_labels(path: Path) -> Labels:
    """Read labels [K]: the .npz of `write_clusters`, or the .npy of `gspure purify`.

    Raise `InputError` if labels are out of range or a cluster is empty.
    """
    if path.suffix == ".npy":
        labels = load_array(path, dtype=np.int32, shape=(None,))
    else:
        labels = load_arrays(path, {"labels": (np.int32, (None,))}, "clusters, as .npz")["labels"]
    in_range = labels.min(initial=NOISE_LABEL) >= NOISE_LABEL and labels.max(initial=0) < max(len(labels), 1)
    if not in_range or not np.bincount(labels[labels > NOISE_LABEL]).all():
        raise InputError(
            path,
            "labels",
            expected=f"{NOISE_LABEL} for noise, 0 .. M-1 without a gap",
            found=f"{labels.min()} to {labels.max()}, or a gap",
        )
    return labels
