"""The whole method on one model in one process."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gspure.cameras import Camera, intrinsics, split, write_cameras
from gspure.cli import main
from gspure.constants import TAU_C
from gspure.errors import InputError
from gspure.files import read_json
from gspure.method.purify import Purification, purify
from gspure.method.weights import accumulate
from gspure.metrics.comparison import read_metrics
from gspure.model import Gaussians, read_model, write_model
from gspure.renderer import Renderer

WALL = 300
HIDDEN = 100


def model() -> Gaussians:
    """An opaque wall, and before it a compact group that is all but transparent."""
    rng = np.random.default_rng(0)
    wall = np.column_stack([rng.uniform(-1.5, 1.5, (WALL, 2)), rng.normal(4, 0.02, WALL)])
    hidden = np.array([0.5, 0.5, 3.0]) + rng.normal(0, 0.05, (HIDDEN, 3))
    count = WALL + HIDDEN
    return Gaussians.from_parameters(
        means=np.concatenate([wall, hidden]),
        quats=np.tile([1.0, 0, 0, 0], (count, 1)),
        scales=np.full((count, 3), 0.1),
        opacities=np.repeat([0.9, 0.005], [WALL, HIDDEN]) + rng.uniform(0, 1e-3, count),
        sh_coeffs=rng.normal(size=(count, 1, 3)),
    )


def cameras(count: int = 9) -> list[Camera]:
    ahead = Camera("", 48, 40, intrinsics(40, 40, 24, 20), np.eye(4))
    shifts = np.eye(4, k=3) * 0.1
    return [replace(ahead, name=f"view_{i}", viewmat=np.eye(4) + (i - count // 2) * shifts) for i in range(count)]


SETTINGS = {"min_cluster_size": 20, "min_samples": 5, "selection": "leaf"}


@pytest.fixture(scope="module")
def purification() -> Purification:
    return purify(model(), cameras(), **SETTINGS)


def test_rows_of_low_weight_are_removed_and_others_stay_bit_identical(purification: Purification) -> None:
    assert purification.prune_mask[WALL:].all()
    assert purification.prune_mask[:WALL].mean() < 0.2
    assert purification.model.table.tobytes() == model().table[~purification.prune_mask].tobytes()
    (comment,) = purification.model.comments
    assert "purified" in comment
    assert "min_cluster_size=20" in comment


def test_weights_are_the_mean_of_the_views_in_the_order_of_their_names(purification: Purification) -> None:
    renderer = Renderer(model(), energy="ray")
    stages = [renderer.contributions(camera) for camera in cameras()]
    np.testing.assert_array_equal(purification.weights, accumulate(stages, WALL + HIDDEN))
    np.testing.assert_array_equal(purify(model(), cameras()[::-1], **SETTINGS).weights, purification.weights)


def test_decisions_do_not_depend_on_the_order_of_rows(purification: Purification) -> None:
    rows = np.random.default_rng(5).permutation(len(model()))
    after = purify(Gaussians(model().table[rows]), cameras(), **SETTINGS)
    for name in ("weights", "labels", "prune_mask"):
        np.testing.assert_array_equal(getattr(after, name), getattr(purification, name)[rows])


@pytest.mark.parametrize(
    ("name", "value"), [("reduction", "mean"), ("min_samples", 0), ("selection", "best"), ("tau_n", float("nan"))]
)
def test_settings_out_of_range_are_refused_before_anything_is_rendered(monkeypatch, name: str, value: object) -> None:
    monkeypatch.setattr("gspure.renderer.Renderer", None)
    with pytest.raises(InputError, match=f": {name}: expected"):
        purify(model(), cameras(), **{name: value})


@pytest.fixture
def command(tmp_path: Path, monkeypatch) -> list[str]:
    """The command on this model, in its folder; figures are not drawn."""
    write_model(tmp_path / "model.ply", model())
    write_cameras(tmp_path / "cameras.json", cameras())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gspure.cli.purify._draw", lambda *_: None)
    return ["purify", "model.ply", "--cameras", "cameras.json", "--out", "out"]


OUT = Path("out")


def test_command_leaves_model_arrays_renders_and_metrics(command: list[str], capsys) -> None:
    write_cameras("cameras.json", cameras(18))
    assert main([*command, "--min-cluster-size", "20", "--min-samples", "5", "--selection", "leaf"]) == 0
    pruned = np.load(OUT / "prune_mask.npy")
    assert read_model(OUT / "purified.ply").table.tobytes() == model().table[~pruned].tobytes()
    assert np.load(OUT / "weights.npy").dtype == np.float32
    assert np.load(OUT / "labels.npy").dtype == np.int32
    held_out = [camera.name for camera in split(cameras(18))[1]]
    rows = read_metrics(OUT / "metrics.csv")
    assert [row.view for row in rows] == held_out
    for title in ("unattacked", "purified"):
        assert [path.stem for path in sorted((OUT / "renders" / title).iterdir())] == held_out
    diagnosis = read_json(OUT / "diagnosis.json")
    low = min(rows, key=lambda row: row.psnr)
    mean = np.mean([row.psnr for row in rows])
    assert diagnosis["psnr"] == pytest.approx({"mean": mean, "worst": low.psnr, "worst_view": low.view})
    settings = read_json(OUT / "provenance.json")["settings"]
    assert (settings["min_samples"], settings["tau_c"]) == (5, TAU_C)
    printed = capsys.readouterr()
    assert f"pruned            {pruned.mean():.1%} of 400 rows" in printed.out
    assert f"PSNR {mean:.1f} dB, worst view {low.psnr:.1f} dB ({low.view})" in printed.out
    assert len([*printed.out.splitlines(), *re.findall("^warning", printed.err, re.MULTILINE)]) <= 8
    assert "contributions: 15 done" in printed.err  # the held-out views do not count towards the weights


def test_a_folder_of_others_is_refused_without_force(command: list[str], monkeypatch, capsys) -> None:
    with monkeypatch.context() as patched:
        patched.setattr("gspure.cli.purify.purify", None)
        OUT.mkdir()
        (OUT / "notes.txt").write_text("of the user")
        assert main(command) == 2
    line = "out: --out: expected an empty folder or results of `gspure purify`, found other files"
    assert line in capsys.readouterr().err
    assert main([*command, "--force"]) == 0
    assert main(command) == 0, "results of an earlier run are replaced"
    assert (OUT / "notes.txt").read_text() == "of the user"


def test_a_decision_that_leaves_no_row_is_refused_in_one_line(command: list[str], capsys) -> None:
    assert main([*command, "--tau-c", "1e-9", "--tau-n", "1e-9"]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert re.search(r"rows: expected some to remain, found 0 of \d+ \(.*tau_c.*\)", last)
    assert not [path for path in OUT.rglob("*") if path.is_file()]


def test_repair_raises_the_psnr_of_the_scene_and_keeps_the_rows(command: list[str], capsys) -> None:
    settings = ["--tau-n", "0.7", "--tau-c", "0.7"]
    assert main([*command, *settings, "--repair", "60"]) == 0
    diagnosis = read_json(OUT / "diagnosis.json")
    rows = len(read_model(OUT / "purified.ply"))
    before, after = (diagnosis[name]["mean"] for name in ("psnr_before_repair", "psnr"))
    assert after > before + 1
    assert re.search(rf"before repair +PSNR {before:.1f} dB.*\nrenders +PSNR {after:.1f} dB", capsys.readouterr().out)
    assert [*(OUT / "renders" / "pruned").glob("*.png")]
    assert main([*command, *settings]) == 0
    assert read_json(OUT / "diagnosis.json")["psnr"]["mean"] == before
    assert len(read_model(OUT / "purified.ply")) == rows
