"""The whole method on one model in one process."""

import errno
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import read_json, write_record, write_text
from gspure.cameras import Camera, intrinsics, orbit_cameras, read_cameras, split, write_cameras
from gspure.cli import main
from gspure.errors import InputError
from gspure.evaluation.comparison import read_metrics
from gspure.images import write_image
from gspure.method.pruning import prune_mask
from gspure.method.purify import Purification, purify
from gspure.method.weights import accumulate
from gspure.model import Gaussians, read_model, write_model
from gspure.renderer import Renderer

WALL, HIDDEN = 300, 100
CLOUDS = {"clusters", "ranks", "kept"}
RESULTS = ("purified.ply", "weights.npy", "labels.npy", "prune_mask.npy", "diagnosis.json", "cameras.json")


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
    views = []
    for i in range(count):
        viewmat = np.eye(4)
        viewmat[0, 3] = 0.1 * (i - count // 2)
        views.append(Camera(f"view_{i}", 48, 40, intrinsics(40, 40, 24, 20), viewmat))
    return views


SETTINGS = {"min_cluster_size": 20, "min_samples": 5, "selection": "leaf"}


@pytest.fixture(scope="module")
def found() -> Purification:
    return purify(model(), cameras(), **SETTINGS)


def test_rows_of_low_weight_are_removed_and_others_stay(found: Purification) -> None:
    assert found.prune_mask[WALL:].all()
    assert found.prune_mask[:WALL].mean() < 0.2


def test_remaining_rows_are_bit_identical_and_say_what_was_done(found: Purification) -> None:
    assert found.model.table.tobytes() == model().table[~found.prune_mask].tobytes()
    (comment,) = found.model.comments
    assert "purified" in comment
    assert "min_cluster_size=20" in comment


def test_weights_are_the_mean_of_the_views_in_the_order_of_their_names(found: Purification) -> None:
    renderer = Renderer(model(), energy="ray")
    stages = [renderer.contributions(camera) for camera in cameras()]
    np.testing.assert_array_equal(found.weights, accumulate(stages, WALL + HIDDEN))
    np.testing.assert_array_equal(purify(model(), cameras()[::-1], **SETTINGS).weights, found.weights)


@pytest.mark.parametrize("selection", ["eom_capped", "leaf"])
def test_decisions_do_not_depend_on_the_order_of_rows(selection: str) -> None:
    given, chosen = model(), {**SETTINGS, "selection": selection}
    rows = np.random.default_rng(5).permutation(len(given))
    before, after = purify(given, cameras(), **chosen), purify(Gaussians(given.table[rows]), cameras(), **chosen)
    for name in ("weights", "labels", "prune_mask"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name)[rows])


def test_parts_of_the_result_belong_together(found: Purification) -> None:
    np.testing.assert_array_equal(found.prune_mask, prune_mask(found.labels, found.weights))
    assert found.diagnosis.pruned_share == found.prune_mask.mean()
    assert found.diagnosis.clusters == found.labels.max() + 1 >= 2


def test_settings_reach_their_stage() -> None:
    given = model(), cameras()
    assert not purify(*given, tau_c=1e9, tau_n=1e9, **SETTINGS).prune_mask.any()
    assert (purify(*given, **SETTINGS | {"min_cluster_size": 400}).labels == -1).all()
    assert purify(*given, energy="ewa", **SETTINGS).weights.sum() > purify(*given, **SETTINGS).weights.sum()
    assert purify(*given, reduction="max", **SETTINGS).weights.max() <= 1


def test_views_that_see_nothing_are_refused() -> None:
    behind = [replace(view, viewmat=np.diag([-1.0, 1, -1, 1]) @ view.viewmat) for view in cameras()]
    with pytest.raises(InputError, match="in view"):
        purify(model(), behind, **SETTINGS)


def test_the_memory_is_announced_before_any_view_and_grows_with_the_model(capsys) -> None:
    def announced(rows: Gaussians) -> float:
        purify(rows, cameras(2), **SETTINGS)
        memory, views = re.search(r"memory: .* ([0-9.]+) GB(.*)", capsys.readouterr().err, re.DOTALL).groups()
        assert "contributions: 2 done" in views
        return float(memory)

    small, table = model(), np.zeros(400_000, model().table.dtype)
    table[: len(small)] = small.table
    table["opacity"][len(small) :] = -20
    assert announced(Gaussians(table)) > announced(small) + table.nbytes / 1e9


def test_no_views_are_refused() -> None:
    with pytest.raises(InputError, match="at least one"):
        purify(model(), [])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("reduction", "mean"),
        ("min_samples", 0),
        ("min_cluster_size", 1),
        ("selection", "best"),
        ("max_cluster_share", 0.0),
        ("tau_c", 0.0),
        ("tau_n", float("nan")),
    ],
)
def test_settings_out_of_range_are_refused_before_anything_is_rendered(monkeypatch, name: str, value: object) -> None:
    monkeypatch.setattr("gspure.renderer.Renderer", None)
    with pytest.raises(InputError, match=f": {name}: expected"):
        purify(model(), cameras(), **{name: value})


def test_non_numeric_settings_are_refused_before_rendering(monkeypatch) -> None:
    monkeypatch.setattr("gspure.renderer.Renderer", None)
    spoilt = model().with_columns({"opacity": np.full(WALL + HIDDEN, np.nan)})
    with pytest.raises(InputError, match="model: opacity: expected finite numbers"):
        purify(spoilt, cameras())


def test_the_commands_one_by_one_give_the_result_of_purify(tmp_path: Path, found: Purification) -> None:
    at = {name: str(tmp_path / name) for name in ("m.ply", "c.json", "stages", "1.tsv", "2.tsv", "w.npy", "f.npy")}
    at |= {name: str(tmp_path / name) for name in ("t.npy", "c.npz", "p.npy", "d.json", "out.ply", "k.npy")}
    write_model(tmp_path / "m.ply", model())
    write_cameras(tmp_path / "c.json", cameras())
    for part in "12":
        where = ["--cameras", at["c.json"], "--split", "all", "--part", f"{part}/2", "--index", at[f"{part}.tsv"]]
        assert main(["contributions", "--model", at["m.ply"], "--stages", at["stages"], *where]) == 0
    for command in (
        ["weights", "--index", at["2.tsv"], at["1.tsv"], "--model", at["m.ply"], "--out", at["w.npy"]],
        ["features", "--model", at["m.ply"], "--weights", at["w.npy"], "--out", at["f.npy"]],
        ["tree", "--features", at["f.npy"], "--min-samples", "5", "--out", at["t.npy"]],
        ["cluster", "--tree", at["t.npy"], "--min-cluster-size", "20", "--selection", "leaf", "--out", at["c.npz"]],
        [
            "prune",
            "--clusters",
            at["c.npz"],
            "--weights",
            at["w.npy"],
            "--out",
            at["p.npy"],
            "--diagnosis",
            at["d.json"],
        ],
        [
            "attack",
            "gspure",
            "--model",
            at["m.ply"],
            "--prune-mask",
            at["p.npy"],
            "--out",
            at["out.ply"],
            "--removed",
            at["k.npy"],
        ],
    ):
        assert main(command) == 0
    np.testing.assert_array_equal(np.load(at["w.npy"]), found.weights)
    np.testing.assert_array_equal(np.load(at["c.npz"])["labels"], found.labels)
    np.testing.assert_array_equal(np.load(at["p.npy"]), found.prune_mask)
    np.testing.assert_array_equal(np.load(at["k.npy"]), found.prune_mask)
    assert read_json(tmp_path / "d.json") == found.diagnosis.to_json()
    assert read_model(tmp_path / "out.ply").table.tobytes() == found.model.table.tobytes()
    settings = read_json(tmp_path / "t.npy.json")["settings"]
    assert settings == {"min_samples": 5, "cluster_on": ["position", "opacity", "weight"]}


def files(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_command_leaves_model_arrays_metrics_and_figures(
    tmp_path: Path, found: Purification, capsys: pytest.CaptureFixture[str]
) -> None:
    write_model(tmp_path / "model.ply", model())
    write_cameras(tmp_path / "cameras.json", cameras(18))
    out = tmp_path / "out"
    command = ["purify", str(tmp_path / "model.ply"), "--cameras", str(tmp_path / "cameras.json"), "--out", str(out)]
    assert main([*command, "--min-cluster-size", "20", "--min-samples", "5", "--selection", "leaf"]) == 0
    pruned = np.load(out / "prune_mask.npy")
    assert read_model(out / "purified.ply").table.tobytes() == model().table[~pruned].tobytes()
    assert np.load(out / "weights.npy").dtype == np.float32
    assert np.load(out / "labels.npy").dtype == np.int32
    held_out = [camera.name for camera in split(cameras(18))[1]]
    assert [row.view for row in read_metrics(out / "metrics.csv")] == held_out
    assert {f"renders/{kind}/{view}.png" for kind in ("unattacked", "purified") for view in held_out} <= set(files(out))
    assert {f"figures/{name}.png" for name in ("before_after", "clusters", "ranks", "kept", "weights")} <= set(
        files(out)
    )
    printed = capsys.readouterr()
    assert "clusters " in printed.out
    assert all(printed.out.count(str(path)) == 1 for path in (out / "figures").glob("*.png"))
    assert "mean" in printed.out
    assert "contributions: 15 done" in printed.err  # the held-out views do not count towards the weights


@pytest.fixture
def command(tmp_path: Path) -> list[str]:
    write_model(tmp_path / "model.ply", model())
    write_cameras(tmp_path / "cameras.json", cameras())
    where = ["--cameras", str(tmp_path / "cameras.json"), "--out", str(tmp_path / "out")]
    return ["purify", str(tmp_path / "model.ply"), *where]


def test_a_model_in_the_folder_of_results_is_not_replaced(tmp_path: Path, command: list[str], capsys) -> None:
    (tmp_path / "out").mkdir()
    command[1] = str((tmp_path / "model.ply").rename(tmp_path / "out" / "purified.ply"))
    before = Path(command[1]).read_bytes()
    write_record(Path(command[1]), inputs={}, settings={})
    assert main(command) == 2
    assert "expected a folder where no output replaces the model" in capsys.readouterr().err
    assert Path(command[1]).read_bytes() == before


def test_a_decision_that_leaves_no_row_is_refused_in_one_line(tmp_path: Path, command: list[str], capsys) -> None:
    assert main([*command, "--tau-c", "1e-9", "--tau-n", "1e-9"]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert re.search(r"rows: expected some to remain, found 0 of \d+ \(.*tau_c.*\)", last)
    assert not (tmp_path / "out").exists()


def broken(*_: object, **__: object) -> None:
    raise RuntimeError("no\nink")


FIGURES = {"gspure.cli.purify.write_panels": {"before_after"}, "gspure.figures.gallery.write_plate": CLOUDS}
FIGURES |= {"gspure.figures.splats.show": {"splats"}}
FIGURES |= {"gspure.figures.gallery.write_weight_histogram": {"weights"}, "gspure.figures.gallery.choose": CLOUDS}


@pytest.mark.parametrize("drawing", FIGURES)
def test_a_figure_that_fails_is_a_warning_and_all_else_stays(
    tmp_path: Path, command: list[str], monkeypatch, capsys, drawing: str
) -> None:
    names = {"before_after", "splats", "weights", *CLOUDS}
    out = tmp_path / "out"
    assert main(command) == 0
    old = {path.name: path.stat().st_mtime_ns for path in (out / "figures").glob("*.png")}
    assert {Path(name).stem for name in old} == names
    capsys.readouterr()
    monkeypatch.setattr(drawing, broken)
    assert main(command) == 0
    assert {*RESULTS, "metrics.csv"} <= {*files(out)}
    assert {path.stem for path in (out / "figures").glob("*.png")} == names - FIGURES[drawing]
    assert not any(path.stat().st_mtime_ns == old[path.name] for path in (out / "figures").glob("*.png"))
    warnings = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning: ")]
    assert len(warnings) == len(FIGURES[drawing])
    for name in FIGURES[drawing]:
        assert any(f"{name}.png: not drawn: no ink" in line for line in warnings)


def test_all_results_are_on_disk_before_a_figure_is_drawn(tmp_path: Path, command: list[str], monkeypatch) -> None:
    def look(*_: object, **__: object) -> None:
        assert {*RESULTS, "metrics.csv"} <= {*files(tmp_path / "out")}
        raise KeyboardInterrupt

    monkeypatch.setattr("gspure.figures.gallery.choose", look)
    assert main(command) == 130
    assert len(read_model(tmp_path / "out" / "purified.ply"))


def test_a_run_killed_while_it_draws_leaves_no_older_figure(tmp_path: Path, command: list[str], monkeypatch) -> None:
    def kill(*_: object) -> None:
        raise KeyboardInterrupt

    older = [tmp_path / "out" / "figures" / name for name in ("before_after.png", "clusters.vtp", "weights.png")]
    older[0].parent.mkdir(parents=True)
    notes = older[0].with_name("notes.png")
    for path in older:
        write_text(path, "older", checksum=True)
    notes.write_text("older")
    monkeypatch.setattr("gspure.cli.purify._draw_views", kill)
    assert main(command) == 130
    assert {*RESULTS} <= {*files(tmp_path / "out")}
    assert not any(path.exists() for path in older)
    assert notes.exists()


def test_a_model_without_colour_leaves_no_older_renders(tmp_path: Path, command: list[str], monkeypatch) -> None:
    assert main(command) == 0
    monkeypatch.setattr("gspure.public_model.PublicModel.visible", False)
    assert main(command) == 0
    assert not [name for name in files(tmp_path / "out") if name.startswith(("renders", "metrics"))]


def test_renders_are_recorded_so_that_a_missing_one_is_refused(tmp_path: Path, command: list[str], capsys) -> None:
    assert main(command) == 0
    before, after = (str(tmp_path / "out" / "renders" / kind) for kind in ("unattacked", "purified"))
    assert main(["metrics", before, after]) == 0
    next(Path(after).glob("*.png")).unlink()
    assert main(["metrics", before, after]) == 2
    assert "images: expected all 2 views" in capsys.readouterr().err


@pytest.mark.parametrize("earlier", [False, True])
def test_a_disk_that_is_full_before_the_metrics_leaves_the_folder_as_it_was(
    tmp_path: Path, command: list[str], monkeypatch, capsys, earlier: bool
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    out = tmp_path / "out"
    if earlier:
        assert main(command) == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    monkeypatch.setattr("gspure.cli.purify.write_metrics", full)
    assert main(command) == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"gspure purify: {out}: No space left on device"
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_the_views_are_among_the_results(tmp_path: Path, command: list[str]) -> None:
    out = tmp_path / "out"
    command = [*command[:3], "orbit", *command[4:], "--up", "0", "0", "1"]
    for _ in range(2):
        assert main(command) == 0
        views = orbit_cameras(model(), up=(0, 0, 1))
        for view, expected in zip(read_cameras(out / "cameras.json"), views, strict=True):
            assert view.numbers == pytest.approx(expected.numbers, abs=1e-5)


def test_the_worst_view_is_in_the_diagnosis_with_a_warning_if_it_is_far_below_the_mean(
    tmp_path: Path, command: list[str], monkeypatch
) -> None:
    monkeypatch.setattr("gspure.evaluation.comparison.FAR_BELOW", -1.0)
    assert main(command) == 0
    rows = read_metrics(tmp_path / "out" / "metrics.csv")
    low = min(rows, key=lambda row: row.psnr)
    diagnosis = read_json(tmp_path / "out" / "diagnosis.json")
    mean = np.mean([row.psnr for row in rows])
    assert diagnosis["psnr"] == pytest.approx({"mean": mean, "worst": low.psnr, "worst_view": low.view})
    assert any(low.view in warning for warning in diagnosis["warnings"])


def test_a_single_view_is_not_called_held_out(tmp_path: Path, command: list[str], capsys) -> None:
    write_cameras(tmp_path / "cameras.json", cameras(1))
    assert main(command) == 0
    printed = capsys.readouterr()
    assert "warning: a single view" in printed.err
    assert "held-out" not in printed.out


def test_renders_of_other_views_in_the_folder_are_refused_before_anything_is_computed(
    tmp_path: Path, command: list[str], monkeypatch, capsys
) -> None:
    write_image(tmp_path / "out" / "renders" / "purified" / "older.png", np.zeros((4, 4, 3)))
    monkeypatch.setattr("gspure.cli.purify.purify", None)
    assert main(command) == 2
    assert "renders/purified: images: expected none of other views, found 1: older.png" in capsys.readouterr().err


def test_a_run_that_fails_before_its_results_leaves_those_of_the_last_one(
    tmp_path: Path, command: list[str], monkeypatch
) -> None:
    out = tmp_path / "out"
    (out / "renders").mkdir(parents=True)
    (out / "purified.ply").write_text("of the last run")

    def purify(*_: object, **__: object) -> None:
        raise InputError("device", "memory", expected="more", found="less")

    monkeypatch.setattr("gspure.cli.purify.purify", purify)
    assert main(command) == 2
    assert files(out) == ["purified.ply"]
    assert (out / "purified.ply").read_text() == "of the last run"


def test_repair_raises_the_psnr_of_the_scene_and_keeps_the_rows(tmp_path: Path, command: list[str], capsys) -> None:
    out, settings = tmp_path / "out", ["--tau-n", "0.7", "--tau-c", "0.7"]
    assert main([*command, *settings, "--repair", "60"]) == 0
    diagnosis, rows = read_json(out / "diagnosis.json"), len(read_model(out / "purified.ply"))
    before, after = diagnosis["psnr_before_repair"]["mean"], diagnosis["psnr"]["mean"]
    assert after > before + 1
    assert f"{before:.2f} dB before, {after:.2f} dB after" in capsys.readouterr().out
    assert [*(out / "renders" / "pruned").glob("*.png")]
    assert main([*command, *settings]) == 0
    diagnosis = read_json(out / "diagnosis.json")
    assert diagnosis["psnr"]["mean"] == before
    assert "psnr_before_repair" not in diagnosis
    assert len(read_model(out / "purified.ply")) == rows
    assert not (out / "renders" / "pruned").exists()
