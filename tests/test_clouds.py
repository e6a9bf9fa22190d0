"""Colours of point clouds, and the data of the 3-D viewer: its slider removes what pruning by rank would remove."""

import base64
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gspure.figures.clouds import Purified
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


def test_only_the_colours_of_the_message_need_a_key(tmp_path: Path) -> None:
    shown = purified(600)
    colours = written(tmp_path, shown)["colours"]
    assert set(colours) == {"colour", "cluster", "rank", "weight", "pruned", "message"}
    bare = written(tmp_path, replace(shown, hidden=None))
    assert set(bare["colours"]) == {"colour", "cluster", "rank", "weight", "pruned"}
    assert "message" not in bare["removed"]
