"""The files of the clustering: what damaged or foreign ones may not reach."""

from pathlib import Path

import numpy as np
import pytest

from gspure.errors import InputError
from gspure.files import save_array
from gspure.method.clusters import Clusters, read_clusters, write_clusters
from gspure.method.tree import read_tree, spanning_tree

POINTS = np.random.default_rng(0).normal(size=(30, 5))


def test_cluster_file_round_trip_is_exact_and_reproducible(tmp_path: Path) -> None:
    labels = np.array([0, -1, 1, 1], np.int32)
    for name in ("a.npz", "b.npz"):
        write_clusters(tmp_path / name, Clusters(labels, 3), {"min_cluster_size": 50, "selection": "leaf"})
    found = read_clusters(tmp_path / "a.npz")
    assert found.labels.tolist() == labels.tolist()
    assert found.labels.dtype == np.int32
    assert found.coincident == 3
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 cut off"])
def test_a_broken_cluster_file_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "clusters.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"clusters\.npz: file: expected clusters, as \.npz"):
        read_clusters(tmp_path / "clusters.npz")


def edited(*values: tuple[int, int, float]) -> np.ndarray:
    """Return a spanning tree of 30 points in which (edge, column, value) are replaced."""
    tree = spanning_tree(POINTS, 5)
    for edge, column, value in values:
        tree[edge, column] = value
    return tree


DAMAGED = {
    "an edge from a point to itself": edited((7, 0, 3), (7, 1, 3)),
    "descending ends": edited()[:, [1, 0, 2]],
    "zeros": np.zeros((29, 3)),
    "half a point": edited((7, 0, 0.5)),
    "a negative point": edited((7, 0, -1)),
    "a point beyond the model": edited((7, 1, 30)),
    "a point beyond integers": edited((7, 1, 1e300)),
    "not a number": edited((7, 2, np.nan)),
    "infinity": edited((28, 2, np.inf)),
    "a negative distance": edited((0, 2, -1)),
    "unsorted": edited()[::-1],
}


@pytest.mark.parametrize("tree", DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_tree_is_refused(tmp_path: Path, tree: np.ndarray) -> None:
    save_array(tmp_path / "tree.npy", tree)
    with pytest.raises(InputError, match=r"tree\.npy: (edge \d+|array): expected"):
        read_tree(tmp_path / "tree.npy")


@pytest.mark.parametrize("count", [1, 2, 30])
def test_a_tree_comes_back_as_it_was_computed(tmp_path: Path, count: int) -> None:
    tree = spanning_tree(POINTS[:count], 5)
    save_array(tmp_path / "tree.npy", tree)
    np.testing.assert_array_equal(read_tree(tmp_path / "tree.npy"), tree)
