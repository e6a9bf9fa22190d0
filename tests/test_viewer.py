"""The data and the page of the 3-D view: its slider removes what pruning by rank would remove."""

import base64
import json
import re
import zlib
from collections.abc import Sequence
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gspure.cameras import Camera, orbit_cameras, write_cameras
from gspure.cli import main
from gspure.constants import ALPHA_MIN
from gspure.figures.clouds import Purified
from gspure.model import write_model
from gspure.public_model import PublicModel
from gspure.viewer import data
from gspure.viewer.data import view_of, write_viewer
from tests.anchor_cases import random_public
from tests.models import blobs, camera, gaussians

RNG = np.random.default_rng(5)


def purified(count: int, tau_c: float = 4.0, tau_n: float = 4.0) -> Purified:
    rng = np.random.default_rng(1)
    means = rng.normal(size=(count, 3)).astype(np.float32)
    labels = rng.integers(-1, 4, count).astype(np.int32)
    labels[:4] = range(4)
    weights = np.where(rng.random(count) < 0.3, 0, rng.random(count)).astype(np.float32) * np.float32(4.0) ** -labels
    hidden = rng.random(count).astype(np.float32)
    return Purified(PublicModel(gaussians(means=means, scales=0.1)), labels, weights, hidden, tau_c, tau_n)


def written(path: Path, shown: Purified, cameras: Sequence[Camera] = ()) -> dict[str, Any]:
    write_viewer(path / "view.json", shown, cameras)
    return json.loads((path / "view.json").read_text())


def unpacked(cloud: dict[str, Any]) -> dict[str, NDArray[Any]]:
    """Return the splats of a cloud as its page computes them."""
    data = zlib.decompress(base64.b64decode(cloud["data"]))
    start = 0
    kinds = {"means": ("<i2", 3), "scales": ("u1", 3), "quats": ("i1", 4)}
    kinds |= {f"paint_{i}": ("u1", 4) for i in range(cloud["paints"])}
    values = {}
    for name, (dtype, width) in kinds.items():
        values[name] = np.frombuffer(data, dtype, width * cloud["splats"], start).reshape(-1, width)
        start += values[name].nbytes
    assert start == len(data)
    return values | {
        "means": cloud["unit"] * np.sinh(cloud["reach"] / 32767 * values["means"]),
        "scales": np.exp(cloud["largest"] - cloud["span"] * (1 - values["scales"] / 255)),
        "opacities": (values["paint_0"][:, 3] / 255) ** 2,
    }


@pytest.mark.parametrize("factors", [(4.0, 4.0), (3.0, 1.0), (0.7, 6.0)])
def test_at_the_decision_the_slider_removes_what_gspure_prunes(tmp_path: Path, factors: tuple[float, float]) -> None:
    shown = purified(600, *factors)
    data = written(tmp_path, shown)
    decision = data["decision"]
    means = shown.means - np.median(shown.means, axis=0)
    first = data["clouds"][0]["starts"][decision]
    assert first == shown.pruned.sum()
    removed = unpacked(data["clouds"][0])["means"][:first]
    distances = np.linalg.norm(removed[:, None] - means[shown.pruned], axis=2)
    assert sorted(distances.argmin(axis=1)) == [*range(first)]
    assert distances.min(axis=1).max() < 1e-3
    for name, values in {"rows": np.ones(600), "scene": shown.weights, "message": shown.hidden}.items():
        shares = data["removed"][name]
        assert shares[decision] == pytest.approx(values[shown.pruned].sum() / values.sum(), abs=1e-4)
        assert (shares[0], shares[-1]) == (0, 1)
        assert np.all(np.diff(shares) >= 0)


def test_splats_keep_their_places_shapes_and_opacities_beside_far_floaters() -> None:
    means = np.append(RNG.normal(size=(300, 3)), [[1e4, 0, 3]], axis=0)
    model = gaussians(means=means, scales=np.exp(RNG.uniform(-7, 2, (301, 3))), opacities=RNG.uniform(0.01, 1, 301))
    splats = unpacked(view_of({"model": PublicModel(model)}, [])["clouds"][0])
    assert splats["means"][:300] == pytest.approx(means[:300] - np.median(means, axis=0), abs=2e-3)
    assert splats["means"][300, 0] == pytest.approx(1e4, rel=1e-3)
    assert splats["scales"] == pytest.approx(model.scales, rel=0.03)
    assert splats["opacities"] == pytest.approx(model.opacities, rel=0.05)


def test_the_message_is_shown_if_a_key_reveals_it(tmp_path: Path) -> None:
    shown = purified(600)
    hidden = gaussians(means=shown.means[:50], scales=0.2)
    revealed = replace(shown, message=lambda camera: (hidden, np.arange(50)))
    names = [[mode["name"] for mode in written(tmp_path, model)["modes"]] for model in (shown, revealed)]
    assert names == [["scene", "pruned", "clusters"], ["scene", "message", "pruned", "clusters"]]


def test_each_anchor_is_shown_with_its_gaussians(tmp_path: Path) -> None:
    anchors = random_public()
    rows = np.concatenate([anchors.gaussians(view)[1] for view in orbit_cameras(anchors.model, count=4)])
    shown = Purified(anchors, np.full(40, -1, np.int32), np.linspace(0, 1, 40, dtype=np.float32))
    (cloud,) = written(tmp_path, shown, orbit_cameras(anchors.model, count=4))["clouds"]
    assert len(np.unique(rows)) <= cloud["splats"] < len(rows)
    assert cloud["starts"][0] == 0
    assert cloud["starts"][-1] == cloud["splats"]


def test_a_page_shows_two_models_beside_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    for name, count in (("before.ply", 40), ("after.ply", 30)):
        write_model(name, blobs(count))
    write_cameras("cameras.json", [camera(name=f"view_{i}") for i in range(9)])
    write_cameras("pair/cameras.json", [camera(name="own")])
    assert main(["view", "before.ply", "--cameras", "pair", "--out", "pair.html"]) == 0
    assert '"name": "own"' in Path("pair.html").read_text()
    assert capsys.readouterr().out == "pair.html\n"
    assert main(["view", "before.ply", "after.ply"]) == 0
    page = Path("view.html").read_text()
    data = json.loads(page.partition('<script type="application/json">')[2].partition("</script>")[0])
    visible = [int((blobs(count).opacities >= ALPHA_MIN).sum()) for count in (40, 30)]
    assert [cloud["of"] for cloud in data["clouds"]] == visible
    assert [view["name"] for view in data["cameras"]["views"]] == ["view_0", "view_8", "overview"]
    assert "divider" in page
    assert capsys.readouterr().out == "view.html\n"


def test_a_cell_of_a_notebook_shows_the_page_of_a_model(tmp_path: Path) -> None:
    view = blobs(30).view([camera(name="from the door")])
    view.write(tmp_path / "view.html")
    page = (tmp_path / "view.html").read_text()
    (shown,) = re.findall('<iframe srcdoc="([^"]*)"', view._repr_html_())
    assert unescape(shown) == page
    assert '"name": "from the door"' in page


def test_large_models_are_sampled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(data, "MOST", 100)
    scales = np.where(np.arange(600) < 50, 10, 0.1)[:, None] * np.ones(3)
    model = PublicModel(gaussians(means=RNG.normal(size=(600, 3)), scales=scales))
    (cloud,) = view_of({"model": model}, [])["clouds"]
    assert (cloud["splats"], cloud["of"]) == (100, 600)
    assert (unpacked(cloud)["scales"][:, 0] > 5).sum() > 40
