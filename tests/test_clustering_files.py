"""The files of the clustering: what damaged or foreign ones may not reach."""

from __future__ import annotations

import re
import time
from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import save_array, write_record
from gspure.cli import main
from gspure.errors import InputError
from gspure.method.clustering.store import Clusters, read_clusters, read_labels, read_tree, write_clusters
from gspure.method.clustering.tree import spanning_tree

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


def test_labels_of_another_type_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "clusters.npz", labels=np.zeros(3), coincident=0)
    with pytest.raises(InputError, match=r"labels: expected int32 .*, found float64 \[3\]"):
        read_clusters(tmp_path / "clusters.npz")


def test_pickled_objects_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "clusters.npz", labels=np.array([{}], dtype=object), coincident=0)
    with pytest.raises(InputError, match="labels: expected numbers, found pickled objects"):
        read_clusters(tmp_path / "clusters.npz")


@pytest.mark.parametrize(("kind", "total"), [("weights", "all ω"), ("opacities", "all opacities"), ("", "all ω")])
def test_pruning_names_what_it_prunes_by(tmp_path: Path, capsys, kind: str, total: str) -> None:
    write_clusters(tmp_path / "clusters.npz", Clusters(np.zeros(3, np.int32), 0), {})
    save_array(tmp_path / "values.npy", np.ones(3, np.float32))
    write_record(tmp_path / "values.npy", inputs={}, settings={}, kind=kind)
    files = {"clusters": "clusters.npz", "weights": "values.npy", "out": "mask.npy"}
    assert main(["prune", *(word for name, file in files.items() for word in (f"--{name}", str(tmp_path / file)))]) == 0
    assert f"0.00% of {total}" in capsys.readouterr().out


@pytest.mark.parametrize("argument", ["clusters.npz", "absent.npy", "labels.npy"])
def test_a_file_of_another_stage_is_refused_in_one_line(tmp_path: Path, capsys, argument: str) -> None:
    write_clusters(tmp_path / "clusters.npz", Clusters(np.zeros(3, np.int32), 0), {})
    np.save(tmp_path / "labels.npy", np.zeros(3, np.int32))
    out = tmp_path / "prune_mask.npy"
    given = ["--clusters", str(tmp_path / "clusters.npz"), "--weights", str(tmp_path / argument), "--out", str(out)]
    assert main(["prune", *given]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert argument in line
    assert not out.exists()


@pytest.mark.parametrize(
    ("labels", "coincident", "line"),
    [
        ([0, 0, -2], 0, "labels: expected -1 to 2, found -2 to 0"),
        ([0, 0, 2**31 - 1], 0, "labels: expected -1 to 2, found -1 to 2147483647"),
        ([0, 0, 2], 0, "labels: expected no empty cluster, found none in cluster 1"),
        ([0, 0, -1], -1, "coincident: expected 0 to 3, found -1"),
        ([0, 0, -1], 4, "coincident: expected 0 to 3, found 4"),
    ],
)
def test_invalid_clusters_are_refused(tmp_path: Path, labels: list[int], coincident: int, line: str) -> None:
    write_clusters(tmp_path / "clusters.npz", Clusters(np.array(labels, np.int32), coincident), {})
    with pytest.raises(InputError, match=line):
        read_clusters(tmp_path / "clusters.npz")


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_labels_are_read_from_the_files_of_purify_and_of_cluster(tmp_path: Path, suffix: str) -> None:
    for labels, fits in (([0, 0, -1], True), ([0, 2, -1], False)):
        if suffix == ".npy":
            save_array(tmp_path / f"l{suffix}", np.array(labels, np.int32))
        else:
            write_clusters(tmp_path / f"l{suffix}", Clusters(np.array(labels, np.int32), 0), {})
        if fits:
            assert read_labels(tmp_path / f"l{suffix}").tolist() == labels
        else:
            with pytest.raises(InputError, match="no empty cluster"):
                read_labels(tmp_path / f"l{suffix}")


def edited(*values: tuple[int, int, float]) -> np.ndarray:
    """Return a spanning tree of 30 points in which (edge, column, value) are replaced."""
    tree = spanning_tree(POINTS, 5)
    for edge, column, value in values:
        tree[edge, column] = value
    return tree


def with_edge_repeated() -> np.ndarray:
    tree = edited()
    tree[7, :2] = tree[6, :2]
    return tree


DAMAGED = {
    "an edge from a point to itself": (edited((7, 0, 3), (7, 1, 3)), "edge 7: expected rows 0 <= a < b < 30"),
    "a repeated edge": (with_edge_repeated(), "edges: expected a spanning tree, found 2 separate parts"),
    "descending ends": (edited()[:, [1, 0, 2]], "edge 0: expected rows 0 <= a < b < 30"),
    "zeros": (np.zeros((29, 3)), "edge 0: expected rows 0 <= a < b < 30"),
    "half a point": (edited((7, 0, 0.5)), "edge 7: expected rows 0 <= a < b < 30"),
    "a negative point": (edited((7, 0, -1)), "edge 7: expected rows 0 <= a < b < 30"),
    "a point beyond the model": (edited((7, 1, 30)), "edge 7: expected rows 0 <= a < b < 30"),
    "a point beyond integers": (edited((7, 1, 1e300)), "edge 7: expected rows 0 <= a < b < 30"),
    "not a number": (edited((7, 2, np.nan)), "array: expected finite numbers"),
    "infinity": (edited((28, 2, np.inf)), "array: expected finite numbers"),
    "a negative distance": (edited((0, 2, -1)), "edge 0: expected distances >= 0, ascending"),
    "unsorted": (edited()[::-1], "edge 1: expected distances >= 0, ascending"),
    "an edge less": (edited()[:-1], "edge|edges"),
}


@pytest.mark.parametrize(("tree", "line"), DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_tree_is_refused_before_it_is_used(tmp_path: Path, capsys, tree: np.ndarray, line: str) -> None:
    save_array(tmp_path / "tree.npy", tree)
    out = tmp_path / "clusters.npz"
    assert main(["cluster", "--tree", str(tmp_path / "tree.npy"), "--min-cluster-size", "5", "--out", str(out)]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert re.search(rf"tree\.npy: ({line})", said)
    assert not out.exists()


@pytest.mark.parametrize("count", [1, 2, 30])
def test_a_tree_comes_back_as_it_was_computed(tmp_path: Path, count: int) -> None:
    tree = spanning_tree(POINTS[:count], 5)
    save_array(tmp_path / "tree.npy", tree)
    np.testing.assert_array_equal(read_tree(tmp_path / "tree.npy"), tree)


def test_a_tree_of_a_million_points_is_checked_within_a_second(tmp_path: Path) -> None:
    rng, count = np.random.default_rng(0), 1_000_000
    names = rng.permutation(count)
    ends = np.sort([names[(rng.random(count - 1) * np.arange(1, count)).astype(int)], names[1:]], axis=0)
    save_array(tmp_path / "tree.npy", np.column_stack([*ends, np.sort(rng.random(count - 1))]))
    began = time.process_time()
    read_tree(tmp_path / "tree.npy")
    assert time.process_time() - began < 1
