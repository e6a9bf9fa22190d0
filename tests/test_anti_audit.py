"""Planted rows neither stop an audit nor change what it finds, and they are named."""

from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import read_json
from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.errors import InputError
from gspure.method import purify as method
from gspure.model import Gaussians, read_model, write_model
from gspure.model.finite import drawable
from gspure.model.suspicious import PILE, lines, suspicious_rows
from gspure.renderer import Renderer
from gspure.schemes.registry import read_public_model
from tests.anti_audit import HIDDEN, NOT_FINITE, WALL, honest, planted, views
from tests.models import blobs, gaussians, joined, with_column

SETTINGS = ["--min-cluster-size", "20", "--min-samples", "5", "--selection", "leaf"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_model(tmp_path / "planted.ply", planted()[0])
    write_cameras(tmp_path / "cameras.json", views())
    return tmp_path


def purify(folder: Path) -> int:
    where = ["--cameras", str(folder / "cameras.json"), "--out", str(folder / "out")]
    return main(["purify", str(folder / "planted.ply"), *where, *SETTINGS])


def test_planted_rows_are_named_with_the_reason() -> None:
    model, expected = planted()
    assert {reason: rows.tolist() for reason, rows in suspicious_rows(model).items()} == expected


def test_honest_rows_are_not_suspicious() -> None:
    assert suspicious_rows(honest()) == suspicious_rows(blobs(2000)) == suspicious_rows(blobs(1)) == {}
    assert suspicious_rows(honest()[np.zeros(WALL + HIDDEN, bool)]) == {}
    flat = gaussians(means=honest().means, scales=[0.2, 0.2, 1e-9])
    assert suspicious_rows(flat) == {}


def test_a_filter_that_fades_rows_is_warned_of_and_part_of_their_scales(tmp_path: Path, capsys) -> None:
    model = honest()
    sizes = np.zeros(len(model), np.float32)
    write_model(tmp_path / "none.ply", with_column(model, "filter_3D", sizes))
    sizes[[3, 8]] = 1e4
    write_model(tmp_path / "faded.ply", with_column(model, "filter_3D", sizes))
    assert not suspicious_rows(read_public_model(tmp_path / "none.ply").model)
    assert not capsys.readouterr().err
    assert suspicious_rows(read_public_model(tmp_path / "faded.ply").model)["oversized"].tolist() == [3, 8]
    assert capsys.readouterr().err.count("filter_3D") == 1


@pytest.mark.parametrize("count", [PILE - 1, PILE])
def test_a_pile_has_at_least_ten_rows(count: int) -> None:
    means = np.concatenate([np.zeros((count, 3)), [[1, 2, 3], [3, 2, 1]]])
    model = gaussians(means=means * [1, 1, -1], scales=np.linspace(0.1, 0.2, count + 2)[:, None])
    expected = {"pile": list(range(count))} if count >= PILE else {}
    assert {reason: rows.tolist() for reason, rows in suspicious_rows(model).items()} == expected


def test_lines_name_the_first_rows_and_count_all() -> None:
    text = "\n".join(lines({"pile": np.arange(40), "needle": np.array([7])}, 50))
    assert "40 of 50" in text
    assert "rows 0, 1, 2" in text
    assert "39" not in text
    assert "row 7" in text
    assert lines({}, 50) == []


def test_rows_that_cannot_be_drawn_become_invisible_and_no_other_changes(capsys) -> None:
    model, expected = planted()
    shown = drawable(model, "model.ply")
    assert suspicious_rows(shown).keys() == suspicious_rows(model).keys() - {"undrawable"}
    finite = np.ones(len(model), bool)
    finite[expected["undrawable"]] = False
    assert shown.table[finite].tobytes() == model.table[finite].tobytes()
    assert (shown.opacities[~finite] == 0).all()
    assert all(np.isfinite(shown.table[name]).all() for name in shown.table.dtype.names)
    assert np.isfinite(shown.scales).all()
    said = capsys.readouterr().err
    assert f"{len(NOT_FINITE)} of {len(model)} rows" in said
    assert str(expected["undrawable"][0]) in said


def test_rows_without_a_rotation_are_named_since_they_are_not_drawn(capsys) -> None:
    turned = blobs(9)
    still = turned.with_columns({f"rot_{i}": np.where(np.arange(9) < 2, 0, turned.quats[:, i]) for i in range(4)})
    assert drawable(still, "model") is still
    assert "2 of 9 rows have a zero quaternion and are not drawn: 0, 1" in capsys.readouterr().err


def test_a_model_without_such_rows_is_left_as_it_is(capsys) -> None:
    model = honest()
    assert drawable(model, "model.ply") is model
    assert capsys.readouterr().err == ""


def test_a_model_of_which_no_row_can_be_drawn_is_refused() -> None:
    model = honest().with_columns({"y": np.full(WALL + HIDDEN, np.inf)})
    with pytest.raises(InputError, match=r"m\.ply: y: expected finite numbers"):
        drawable(model, "m.ply")


def test_anchors_that_are_not_finite_are_refused_since_a_network_decides_their_opacity() -> None:
    anchors = np.zeros(3, [(name, "<f4") for name in (*blobs(1).table.dtype.names, "f_anchor_feat_0", "f_offset_0")])
    anchors["x"][1] = np.nan
    with pytest.raises(InputError, match=r"m\.ply: x: expected finite numbers, .* first in row 1"):
        drawable(Gaussians(anchors), "m.ply")


def test_purify_continues_and_names_suspicious_rows(folder: Path, capsys) -> None:
    assert purify(folder) == 0
    model, expected = planted()
    assert read_json(folder / "out" / "diagnosis.json")["suspicious"] == expected
    printed = capsys.readouterr().out
    assert "suspicious rows" in printed
    weights, pruned = (np.load(folder / "out" / f"{name}.npy") for name in ("weights", "prune_mask"))
    assert np.isfinite(weights).all()
    assert (weights >= 0).all()
    assert (weights[expected["undrawable"]] == 0).all()
    assert len(read_model(folder / "out" / "purified.ply")) == len(model) - pruned.sum()
    assert pruned[WALL : WALL + HIDDEN].mean() > 0.9
    assert {path.name for path in (folder / "out" / "figures").glob("*.png")} == {
        f"{name}.png" for name in ("before_after", "clusters", "ranks", "kept", "splats", "weights")
    }


def test_planted_rows_contribute_at_most_all_light() -> None:
    model = drawable(planted()[0], "model")
    renderer = Renderer(model, energy="ray")
    for view in views():
        sums = renderer.contributions(view)["sum"]
        assert np.isfinite(sums).all()
        assert (sums >= 0).all()
        assert sums.sum(dtype=np.float64) <= view.width * view.height * (1 + 1e-5)


def test_info_names_suspicious_rows(folder: Path, capsys) -> None:
    assert main(["info", str(folder / "planted.ply")]) == 0
    text = capsys.readouterr().out
    for reason in planted()[1]:
        assert reason.replace("_", "-") in text


def test_every_stage_continues_after_suspicious_rows(folder: Path, capsys) -> None:
    model, cameras = str(folder / "planted.ply"), ["--cameras", str(folder / "cameras.json")]
    at = {
        name: str(folder / name) for name in ("i.tsv", "w.npy", "f.npy", "t.npy", "c.npz", "p.npy", "d.json", "out.ply")
    }
    weights = ["--weights", at["w.npy"]]
    figures = ["--clusters", at["c.npz"], "--out", str(folder / "figures")]
    for command in (
        ["contributions", "--model", model, *cameras, "--stages", str(folder / "stages"), "--index", at["i.tsv"]],
        ["weights", "--index", at["i.tsv"], "--model", model, "--out", at["w.npy"]],
        ["features", "--model", model, *weights, "--out", at["f.npy"]],
        ["tree", "--features", at["f.npy"], "--min-samples", "5", "--out", at["t.npy"]],
        ["cluster", "--tree", at["t.npy"], "--min-cluster-size", "20", "--selection", "leaf", "--out", at["c.npz"]],
        [
            "prune",
            "--clusters",
            at["c.npz"],
            *weights,
            "--model",
            model,
            "--diagnosis",
            at["d.json"],
            "--out",
            at["p.npy"],
        ],
        ["attack", "gspure", "--model", model, "--prune-mask", at["p.npy"], "--out", at["out.ply"]],
        ["attack", "quantize", "--model", model, "--out", str(folder / "quantized.ply")],
        ["render", at["out.ply"], *cameras, "--out", str(folder / "renders")],
        ["render", str(folder / "quantized.ply"), *cameras, "--out", str(folder / "quantized")],
        ["figures", "model", "--model", model, *weights, *figures, *cameras],
    ):
        assert main(command) == 0, command
        if command[0] == "contributions":
            assert "suspicious rows" in capsys.readouterr().err
    assert purify(folder) == 0
    assert read_json(folder / "d.json").items() <= read_json(folder / "out" / "diagnosis.json").items()
    for name, stage in (("weights.npy", "w.npy"), ("prune_mask.npy", "p.npy")):
        np.testing.assert_array_equal(np.load(folder / "out" / name), np.load(at[stage]))


def test_planted_rows_that_are_not_drawn_leave_weights_as_they_are(folder: Path) -> None:
    scene = honest()
    broken = gaussians(means=np.full((4, 3), 3.0), scales=0.1).with_columns({"z": np.full(4, np.nan)})
    expected = method.purify(scene, views(), min_cluster_size=20, min_samples=5, selection="leaf")
    found = method.purify(joined(scene, broken), views(), min_cluster_size=20, min_samples=5, selection="leaf")
    np.testing.assert_array_equal(found.weights[: len(scene)], expected.weights)
    assert found.prune_mask[len(scene) :].all()


@pytest.mark.parametrize("selection", ["leaf", "eom_capped"])
def test_planted_far_rows_change_no_cluster_and_no_decision_of_other_rows(selection: str) -> None:
    scene = honest()
    far = gaussians(means=[[1e30, 0, 0], [-1e30, 1e30, 4]], scales=0.1, opacities=[0.9, 0.001])
    settings = {"min_cluster_size": 20, "min_samples": 5, "selection": selection}
    expected = method.purify(scene, views(), **settings)
    found = method.purify(joined(far, scene), views(), **settings)
    np.testing.assert_array_equal(found.labels[2:], expected.labels)
    np.testing.assert_array_equal(found.prune_mask[2:], expected.prune_mask)
