"""Colours of point clouds, and the data of the 3-D viewer: its slider removes what pruning by rank would remove."""

import base64
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from gspure.figures import style
from gspure.figures.clouds import Purified, by_cluster, by_decision, by_rank, by_share, by_weight, ranks
from gspure.figures.viewer import write_viewer
from gspure.public_model import PublicModel
from tests.models import gaussians

AXES = np.eye(3)[[1, 2, 0]]


def purified(count: int, tau_c: float = 4.0, tau_n: float = 4.0) -> Purified:
    rng = np.random.default_rng(1)
    means = rng.normal(size=(count, 3)).astype(np.float32)
    labels = rng.integers(-1, 4, count).astype(np.int32)
    labels[:4] = range(4)
    weights = np.where(rng.random(count) < 0.3, 0, rng.random(count)).astype(np.float32) * np.float32(4.0) ** -labels
    hidden = rng.random(count).astype(np.float32)
    public = PublicModel(gaussians(means=means, scales=0.1))
    return Purified(public, labels, weights, hidden, tau_c, tau_n)


def written(path: Path, shown: Purified) -> dict[str, Any]:
    write_viewer(path / "viewer.json", shown, AXES)
    return json.loads((path / "viewer.json").read_text())


def unpacked(text: str, dtype: str) -> NDArray[Any]:
    return np.frombuffer(base64.b64decode(text), dtype)


@pytest.mark.parametrize("factors", [(4.0, 4.0), (3.0, 1.0), (0.7, 6.0)])
def test_at_the_decision_the_slider_removes_what_gspure_prunes(tmp_path: Path, factors: tuple[float, float]) -> None:
    shown = purified(600, *factors)
    data = written(tmp_path, shown)
    removed = unpacked(data["removal"], "<u2") <= data["cuts"][data["decision"]]
    np.testing.assert_array_equal(removed, shown.pruned)
    for name, values in {"rows": np.ones(600), "scene": shown.weights, "message": shown.hidden}.items():
        assert data["removed"][name][data["decision"]] == pytest.approx(
            values[shown.pruned].sum() / values.sum(), abs=1e-4
        )
        assert (data["removed"][name][0], data["removed"][name][-1]) == (0, 1)
        assert np.all(np.diff(data["removed"][name]) >= 0)


def test_the_slider_removes_clusters_as_a_whole(tmp_path: Path) -> None:
    shown = purified(600)
    data = written(tmp_path, shown)
    clusters, removal = unpacked(data["clusters"], "<u2"), unpacked(data["removal"], "<u2")
    assert set(clusters[shown.labels < 0]) == {65535}
    for label in range(4):
        rows = shown.labels == label
        (cluster,) = set(clusters[rows])
        assert len(set(removal[rows])) == 1
        assert data["sizes"][cluster] == rows.sum()
        assert data["cluster_weights"][cluster] == pytest.approx(shown.weights[rows].mean(), rel=1e-5)


def test_points_lie_along_the_axes_of_the_world(tmp_path: Path) -> None:
    shown = purified(600)
    data = written(tmp_path, shown)
    positions = unpacked(data["positions"], "<i2").reshape(-1, 3) / 32767 * data["reach"]
    local = shown.means @ AXES.T
    inside = (np.abs(positions) < data["reach"]).all(axis=1)
    scale, offset = np.polyfit(local[inside, 0], positions[inside, 0], 1)
    np.testing.assert_allclose(positions[inside, 0], scale * local[inside, 0] + offset, atol=1e-3)
    assert 1 <= np.quantile(np.abs(positions), 0.98) <= data["reach"]


def test_colours_are_those_of_the_figures_and_the_message_needs_a_key(tmp_path: Path) -> None:
    shown = purified(600)
    colours = written(tmp_path, shown)["colours"]
    assert set(colours) == {"colour", "cluster", "rank", "weight", "pruned", "message"}
    bare = written(tmp_path, replace(shown, hidden=None))
    assert set(bare["colours"]) == {"colour", "cluster", "rank", "weight", "pruned"}
    assert "message" not in bare["removed"]
    kept = bare["colours"]["pruned"]
    index = unpacked(kept["index"], "u1")
    assert len(set(index[shown.pruned])) == len(set(index[~shown.pruned])) == 1


def hexadecimal(text: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(text[1:]))


def test_clusters_have_colours_by_size_pale_ones_if_they_are_kept_and_noise_is_grey() -> None:
    sizes = [30 - i for i in range(len(style.CLUSTERS) + 3)]
    labels = np.concatenate([np.repeat(np.arange(len(sizes)), sizes), [-1, -1]]).astype(np.int32)
    relabelled = np.where(labels < 0, -1, len(sizes) - 1 - labels).astype(np.int32)  # the largest comes last by number
    for named in (labels, relabelled):
        pruned = labels % 3 == 0  # not the noise
        shown = by_cluster(named, pruned)
        for cluster, start in enumerate(np.cumsum([0, *sizes[:-1]])):
            base = hexadecimal(style.CLUSTERS[cluster % len(style.CLUSTERS)])
            lighter = shown.colours[start].astype(int) - base
            assert (lighter == 0).all() if pruned[start] else lighter.sum() > 0
        assert tuple(shown.colours[-1]) == hexadecimal(style.NOISE)
        text = " ".join(label for row in shown.legend for label, _ in row)
        fates = re.fullmatch("pruned:(.*)kept \\(pale\\):(.*)noise:.*", text).groups()
        assert all(f"{size / len(labels):.1%}" in fates[i % 3 > 0] for i, size in enumerate(sizes[:9]))


@settings(deadline=None)
@given(arrays(np.float32, 40, elements=st.floats(0, 9, width=16)), arrays(np.int32, 40, elements=st.integers(-1, 1)))
def test_the_rank_is_that_of_the_weight_that_decides(weights: np.ndarray, labels: np.ndarray) -> None:
    labels[:2] = 0, 1
    rank = ranks(labels, weights)
    deciding = weights.astype(np.float64)
    for cluster in (0, 1):
        deciding[labels == cluster] = weights[labels == cluster].mean(dtype=np.float64)
        assert np.ptp(rank[labels == cluster]) == 0
    for k in range(40):
        before, tied = np.sum(deciding < deciding[k]), np.sum(deciding == deciding[k])
        assert rank[k] == pytest.approx((before + (tied - 1) / 2) / 39)


@pytest.mark.parametrize(
    ("shown", "colours"),
    [
        (by_rank(np.array([0, 0.5, 1.0])), {0: "#440154", 2: "#fde724"}),  # viridis
        (by_weight(np.array([0.1, 0, 10], np.float32)), {0: "#440154", 1: style.NOISE, 2: "#fde724"}),
        (
            by_share(np.array([2, 0, 3, 0], np.float32), np.array([0, 5, 3, 0], np.float32)),
            {0: style.KEPT, 1: style.MESSAGE, 3: style.NOISE},
        ),
        (by_decision(np.array([True, False])), {0: style.PRUNED, 1: style.KEPT}),
    ],
    ids=["rank", "weight", "share", "decision"],
)
def test_ends_of_scales_unknown_values_and_decisions_have_their_colours(shown, colours) -> None:
    assert {row: tuple(shown.colours[row]) for row in colours} == {k: hexadecimal(c) for k, c in colours.items()}
    assert (shown.scale is None) == bool(shown.legend)
    if shown.scale is not None:
        assert tuple(shown.scale[0]) == hexadecimal(colours[0])
