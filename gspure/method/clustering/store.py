"""The files ``tree.npy`` and ``clusters.npz``, checked here since the kernels of the clustering trust their input."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gspure.artifacts import load_array, load_arrays, save_arrays
from gspure.artifacts.arrays import Kind
from gspure.constants import NOISE_LABEL
from gspure.errors import InputError
from gspure.files import Float64
from gspure.method.clustering.selection import Labels
from gspure.method.clustering.tree import Tree


class Clusters(NamedTuple):
    """Labels [K], int32, and the number of coincident points (see `gspure.method.clustering.coincident_points`)."""

    labels: Labels
    coincident: int


def write_clusters(path: Path, clusters: Clusters, settings: Mapping[str, int | float | str]) -> None:
    """Write clusters and their settings as .npz without pickle, whole or not at all."""
    entries = {"labels": clusters.labels, "coincident": np.array(clusters.coincident)}
    entries |= {name: np.array(value) for name, value in settings.items()}
    save_arrays(path, entries)


def read_clusters(path: Path) -> Clusters:
    """Read clusters, or raise `InputError` if the file is not one of `write_clusters`."""
    kinds: dict[str, Kind] = {"labels": (np.int32, (None,)), "coincident": (np.integer, ())}
    labels, coincident = load_arrays(path, kinds, "clusters, as .npz, from `gspure cluster`").values()
    _require_clusters(path, labels)
    if not 0 <= coincident <= len(labels):
        raise InputError(path, "coincident", expected=f"0 to {len(labels)}", found=str(coincident))
    return Clusters(labels, int(coincident))


def read_labels(path: Path) -> Labels:
    """Read the labels [K] of `gspure cluster`, .npz, or of `gspure purify`, .npy, checked as `read_clusters` does."""
    if path.suffix != ".npy":
        return read_clusters(path).labels
    labels = load_array(path, dtype=np.int32, shape=(None,))
    _require_clusters(path, labels)
    return labels


def _require_clusters(path: Path, labels: Labels) -> None:
    """Refuse labels below `NOISE_LABEL`, and numbers of clusters with a gap."""
    lowest, highest = labels.min(initial=NOISE_LABEL), labels.max(initial=NOISE_LABEL)
    if lowest < NOISE_LABEL or highest >= len(labels):
        expected, found = f"{NOISE_LABEL} to {len(labels) - 1}", f"{lowest} to {highest}"
        raise InputError(path, "labels", expected=expected, found=found)
    if (sizes := np.bincount(labels[labels != NOISE_LABEL])).min(initial=1) < 1:
        raise InputError(path, "labels", expected="no empty cluster", found=f"none in cluster {sizes.argmin()}")


def read_tree(path: Path) -> Tree:
    """Read a spanning tree [K-1,3] of `gspure.method.clustering.tree.spanning_tree`.

    Raise `InputError` if the file is corrupt, or does not hold the edges (a, b, distance) of a spanning tree with 0
    <= a < b < K, sorted by distance.
    """
    tree = load_array(path, dtype=np.float64, shape=(None, 3))
    a, b, distances = tree.T
    count = len(tree) + 1
    ordered = (a >= 0) & (a < b) & (b < count) & (np.trunc(a) == a) & (np.trunc(b) == b)
    sorted_ = np.diff(distances, prepend=0) >= 0
    for fits, expected in ((ordered, f"rows 0 <= a < b < {count}"), (sorted_, "distances >= 0, ascending")):
        if not fits.all():
            edge = int(fits.argmin())
            raise InputError(path, f"edge {edge}", expected=expected, found=" ".join(map(str, tree[edge])))
    if (parts := _parts(a, b, count)) > 1:
        raise InputError(path, "edges", expected="a spanning tree", found=f"{parts} separate parts")
    return tree


def _parts(a: Float64, b: Float64, count: int) -> int:
    """Return the number of connected components of a graph of `count` points with edges (a, b)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = (np.ones(len(a), np.bool_), (a.astype(np.int32), b.astype(np.int32)))
    return int(connected_components(coo_array(edges, (count, count)), directed=False, return_labels=False))
