"""HDBSCAN: its definition, the library, and its files."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
from sklearn.metrics import adjusted_rand_score

from gspure.arrays import save_array
from gspure.errors import InputError
from gspure.method import tree
from gspure.method.clusters import SELECTIONS, select
from gspure.method.diagnosis import diagnose
from gspure.method.tree import read_tree, spanning_tree


def heavy_tailed(seed: int, count: int, columns: int = 5) -> np.ndarray:
    """Points as the features are: surfaces, far outliers, an opacity of two humps, a lognormal weight."""
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 1, (count, columns))
    points[: count // 3] *= 0.05
    points[: count // 10, :3] *= rng.pareto(1.5, (count // 10, 1)) * 20
    points[:, -1] = rng.lognormal(0, 2, count)
    return points


def with_ties(seed: int, count: int) -> np.ndarray:
    """Heavy-tailed points: some on a lattice, some in piles."""
    points = heavy_tailed(seed, count)
    points[: count // 3] = points[: count // 3].round(1)
    points[count // 2 : count // 2 + count // 6] = points[count // 2]
    points[-count // 10 :] = points[: count // 10]
    return points


def blobs(*centres: float, each: int = 100, scattered: int = 0) -> np.ndarray:
    rng = np.random.default_rng(1)
    tight = [rng.normal(centre, 0.05, (each, 3)) for centre in centres]
    return np.concatenate([*tight, rng.uniform(-3, max(centres) + 3, (scattered, 3))])


def test_a_device_without_double_precision_has_a_tree_as_short(monkeypatch) -> None:
    points = with_ties(0, 400)
    lengths = spanning_tree(points)[:, 2]
    monkeypatch.setattr(tree, "_tree_of_distinct", lambda *known: tree.hdbscan_tree(*known[:3]))
    np.testing.assert_allclose(spanning_tree(points)[:, 2], lengths, rtol=1e-12)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.integers(2, 120), st.integers(1, 15), st.booleans())
def test_tree_is_a_minimum_spanning_tree_by_brute_force(seed: int, count: int, min_samples: int, rounded: bool) -> None:
    points = heavy_tailed(seed, count)
    points = points.round() if rounded else points  # many ties and duplicates
    tree = spanning_tree(points, min_samples)
    a, b = tree[:, :2].astype(int).T
    edges = csr_array((np.ones(len(tree)), (a, b)), shape=(count, count))
    assert len(tree) == count - 1
    assert connected_components(edges)[0] == 1
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    core = np.sort(apart, axis=1)[:, min(min_samples, count - 1)]  # the point itself comes first
    distances = np.maximum(apart, np.maximum(core[:, None], core[None]))
    shortest = minimum_spanning_tree(distances + 1)  # 0 would be no edge
    np.testing.assert_allclose(tree[:, 2], np.sort(shortest.data) - 1, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(tree[:, 2], distances[a, b], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("selection", ["eom", "leaf"])
def test_clusters_equal_those_of_the_public_hdbscan(selection: str) -> None:
    import hdbscan

    points = np.concatenate([heavy_tailed(4, 2500), blobs(20, 22, 40)[:, [0, 1, 2, 0, 1]]])
    public = hdbscan.HDBSCAN(
        min_cluster_size=25,
        min_samples=10,
        cluster_selection_method=selection,
        algorithm="boruvka_kdtree",
        approx_min_span_tree=False,
        core_dist_n_jobs=1,
    )
    labels = public.fit_predict(points)
    ours = select(spanning_tree(points, 10), 25, selection)
    assert ours.max() == labels.max() > 3
    assert adjusted_rand_score(ours, labels) > 0.995  # hdbscan joins edges of equal length one by one


@pytest.mark.parametrize("selection", SELECTIONS)
@pytest.mark.parametrize("ties", [False, True])
def test_clusters_do_not_depend_on_the_order_of_rows(selection: str, ties: bool) -> None:
    points = (with_ties if ties else heavy_tailed)(8, 3000)
    labels = select(spanning_tree(points, 10), 15, selection)
    assert labels.max() > 3
    for seed in range(3):
        rows = np.random.default_rng(seed).permutation(len(points))
        np.testing.assert_array_equal(select(spanning_tree(points[rows], 10), 15, selection), labels[rows])


def test_edges_of_equal_length_join_at_once() -> None:
    """Two groups of three and two single points, all one apart: at that distance there is one cluster, not a chain."""
    near, far = 0.1, 1.0
    edges = [(0, 1, near), (1, 2, near), (3, 4, near), (4, 5, near), (2, 6, far), (6, 7, far), (7, 3, far)]
    for order in ([0, 1, 2], [2, 1, 0], [1, 0, 2]):
        tree = np.array([*edges[:4], *(edges[4:][i] for i in order)])
        assert select(tree, 2, "leaf").tolist() == [0, 0, 0, 1, 1, 1, -1, -1]


def test_excess_of_mass_keeps_a_group_together_that_leaf_and_a_cap_split() -> None:
    points = np.concatenate([blobs(*(0.15 * np.arange(8)), each=60), blobs(90.0, each=60)])
    tree = spanning_tree(points, 5)
    whole, capped, leaves = (select(tree, 30, selection, 0.2) for selection in ("eom", "eom_capped", "leaf"))
    assert np.bincount(whole[whole >= 0]).max() > 0.8 * len(points)
    assert np.bincount(capped[capped >= 0]).max() <= 0.2 * len(points)
    assert capped.max() > whole.max()
    assert leaves.max() > whole.max()


@pytest.mark.parametrize("count", [1, 2, 3, 9, 19])
@pytest.mark.parametrize("selection", SELECTIONS)
def test_too_few_points_for_two_clusters_are_noise(count: int, selection: str) -> None:
    tree = spanning_tree(heavy_tailed(6, count), 10)
    assert tree.shape == (count - 1, 3)
    assert select(tree, 10, selection).tolist() == [-1] * count


def test_the_diagnosis_describes_the_clustering() -> None:
    labels = np.array([0, 0, 0, 0, 1, 1, -1, -1, -1, -1], np.int32)
    weights = np.array([1, 1, 1, 9, 20, 28, 1, 1, 9, 9], np.float32)  # mean 8; the first cluster's mean 3
    found = diagnose(labels, weights, tau_c=2, tau_n=2)
    assert (found.gaussians, found.clusters) == (10, 2)
    assert (found.largest_share, found.noise_share) == (0.4, 0.4)
    assert (found.pruned_share, found.pruned_as_cluster, found.pruned_as_noise) == (0.6, 0.4, 0.2)
    assert found.pruned_weight_share == pytest.approx(14 / 80)
    assert found.plain_share == 0.5
    assert found.changed_share == pytest.approx(1 / 6)
    assert found.changed_share_clustered == 0.25
    assert found.warnings == ()


def test_diagnosis_warns_of_a_collapsed_clustering_and_of_a_decision_that_leaves_no_row() -> None:
    found = diagnose(np.array([0] * 6 + [1] * 2, np.int32), np.ones(8))
    assert "largest cluster holds 75%" in found.warnings[0]
    assert not any("every row is pruned" in text for text in found.warnings)
    labels = np.array([0] * 4 + [1] * 4, np.int32)
    assert any("every row is pruned" in text for text in diagnose(labels, np.ones(8), tau_c=0.5).warnings)


@pytest.mark.parametrize(("edge", "column", "value"), [(7, 0, 0.5), (7, 1, 30), (7, 2, np.nan), (0, 2, -1)])
def test_a_damaged_tree_is_refused(tmp_path: Path, edge: int, column: int, value: float) -> None:
    tree = spanning_tree(np.random.default_rng(0).normal(size=(30, 5)), 5)
    save_array(tmp_path / "tree.npy", tree)
    np.testing.assert_array_equal(read_tree(tmp_path / "tree.npy"), tree)
    tree[edge, column] = value
    save_array(tmp_path / "tree.npy", tree)
    with pytest.raises(InputError, match=r"tree\.npy: (edge \d+|array): expected"):
        read_tree(tmp_path / "tree.npy")
