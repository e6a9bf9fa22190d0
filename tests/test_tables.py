"""Tables over schemes, scenes and variants."""

import csv
import re
import shutil
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import save_array, write_json, write_record
from gspure.cli import main
from gspure.errors import InputError
from gspure.evaluation.comparison import RENDER, TRUTH, compare, pair_images, read_metrics, write_metrics
from gspure.evaluation.csv_tables import write_table
from gspure.evaluation.detection import Detection
from gspure.evaluation.metrics import METRICS, Metric
from gspure.evaluation.outcomes import collect
from gspure.evaluation.results import read_results, write_results
from gspure.evaluation.retrieval import Retrieval, Retrieved
from gspure.evaluation.summary import summarize
from gspure.failures import Failure, status_of
from gspure.images import write_image
from gspure.report.tables import model_table, results_markdown
from tests.contest_cases import benchmark, measured

ROWS = {  # scene PSNR, message PSNR of two views
    "unattacked": ((30.0, 26.0), (25.0, 23.0)),
    "gspure": ((29.0, 25.0), (11.0, 9.0)),
    "gaussian_noise": ((27.0, 23.0), (24.0, 22.0)),
}


def shown(outcomes) -> dict[str, dict[str, str]]:
    """The cells of a model's table by variant and column."""
    table = model_table(outcomes)
    titles = [column.full_title for column in table.columns]
    return {str(row.cells[0]): dict(zip(titles, map(str, row.cells), strict=True)) for row in table.rows}


def results(tmp_path: Path, scene: str = "room") -> tuple[list[Path], list[Path], Path]:
    folder = tmp_path / "planted" / scene
    truth = np.array([True, True, False, False, False])
    pruned = {"unattacked": [0, 0, 0, 0, 0], "gspure": [1, 0, 1, 0, 0], "gaussian_noise": [0, 0, 0, 0, 0]}
    metrics, masks = [], []
    for variant, (scene_psnr, message_psnr) in reversed(ROWS.items()):
        rows = [measured("scene", psnr, view=str(i)) for i, psnr in enumerate(scene_psnr)]
        rows += [measured("message", psnr, 0.8, view=str(i)) for i, psnr in enumerate(message_psnr)]
        metrics.append(folder / variant / "metrics.csv")
        write_metrics(metrics[-1], rows)
        masks.append(folder / variant / "public" / "prune_mask.npy")
        masks[-1].parent.mkdir()
        np.save(masks[-1], np.array(pruned[variant], bool))
    (folder / "key").mkdir()
    np.save(folder / "key" / "message_rows.npy", truth)
    return metrics, masks, folder / "key" / "message_rows.npy"


def test_equation_of_the_score_is_message_drop_minus_scene_drop(tmp_path: Path) -> None:
    metrics, _, _ = results(tmp_path)
    scores = {outcome.variant: outcome.score for outcome in collect(metrics)}
    assert scores == {"unattacked": 0.0, "gspure": 14.0 - 1.0, "gaussian_noise": 1.0 - 3.0}


def test_reference_comes_first_then_the_order_given(tmp_path: Path) -> None:
    metrics, _, _ = results(tmp_path)
    assert [outcome.variant for outcome in collect(metrics)] == ["unattacked", "gaussian_noise", "gspure"]


def test_precision_and_recall_come_from_the_masks_below_the_same_folders(tmp_path: Path) -> None:
    metrics, masks, truth = results(tmp_path)
    other_metrics, other_masks, _ = results(tmp_path, "vault")
    outcomes = collect(metrics + other_metrics, masks + other_masks, [truth])
    found = {(o.scene, o.variant): (o.pruned_share, o.precision, o.recall) for o in outcomes}
    assert found["room", "gspure"] == (0.4, 0.5, 0.5)
    assert found["vault", "gspure"][0] == 0.4
    assert np.isnan(found["vault", "gspure"][1:]).all()


def test_a_mask_may_be_a_link_to_another_folder(tmp_path: Path) -> None:
    metrics, masks, _ = results(tmp_path)
    expected = [outcome.pruned_share for outcome in collect(metrics, masks)]
    for number, mask in enumerate(masks):
        mask.symlink_to(mask.rename(tmp_path / f"{number}.npy"))
    assert [outcome.pruned_share for outcome in collect(metrics, masks)] == pytest.approx(expected, nan_ok=True)


def test_without_reference_variant_there_is_no_score(tmp_path: Path) -> None:
    metrics, _, _ = results(tmp_path)
    (outcome,) = collect([path for path in metrics if "gspure" in path.parts])
    assert np.isnan(outcome.score)
    assert outcome.targets["scene"].psnr == 27.0


@pytest.mark.parametrize(
    ("of_variant", "message"),
    [
        ({"a": 29.0}, "scene: expected the views of unattacked, 2 in the mean PSNR, found 1; not in both: b"),
        ({"a": 29.0, "b": 31.0, "c": 30.0}, "not in both: c"),
        ({"a": 29.0, "c": 30.0}, "not in both: b, c"),
    ],
)
def test_a_variant_measured_in_other_views_is_refused(tmp_path: Path, of_variant: dict, message: str) -> None:
    for variant, views in {"unattacked": {"a": 30.0, "b": 32.0}, "gspure": of_variant}.items():
        rows = [measured("scene", psnr, view=view) for view, psnr in views.items()]
        write_metrics(tmp_path / "planted" / "room" / variant / "metrics.csv", rows)
    with pytest.raises(InputError, match=message):
        collect(sorted(tmp_path.rglob("metrics.csv")))


@pytest.mark.parametrize(
    ("variant", "targets", "refused"),
    [
        ("gspure", ["Scene", "message"], True),
        ("gspure", ["message"], True),
        ("gspure", ["scene", "message", "message_oracle"], True),
        ("clean", ["Scene", "message"], True),
        ("wrong_key", ["message"], False),
    ],
)
def test_a_variant_without_the_targets_of_its_model_is_refused(tmp_path, variant, targets, refused) -> None:
    for name, measured_targets in {"unattacked": ["scene", "message"], variant: targets}.items():
        rows = [measured(target, 30.0, view="a") for target in measured_targets]
        write_metrics(tmp_path / "planted" / "room" / name / "metrics.csv", rows)
    with pytest.raises(InputError, match="targets") if refused else nullcontext():
        collect(sorted(tmp_path.rglob("metrics.csv")))


@pytest.mark.parametrize("views", [{}, {"scene": ["off_path_0"]}, {"scene": ["a"], "message": ["off_path_0"]}])
def test_metrics_without_a_view_on_the_camera_path_are_refused(tmp_path: Path, views: dict[str, list[str]]) -> None:
    rows = [measured(target, 30.0, view=view) for target in views for view in views[target]]
    write_metrics(tmp_path / "metrics.csv", rows)
    with pytest.raises(InputError, match="on the camera path"):
        read_metrics(tmp_path / "metrics.csv")


def test_a_view_that_is_identical_in_one_variant_counts_in_none(tmp_path: Path) -> None:
    """As the black image of an object that is out of view, which the black baseline equals."""
    views = {"unattacked": {"a": 30.0, "b": 32.0}, "gspure": {"a": 29.0, "b": 20.0}, "black": {"a": 9.0, "b": np.inf}}
    for variant, psnrs in views.items():
        rows = [measured("message", psnr, view=view) for view, psnr in psnrs.items()]
        write_metrics(tmp_path / "planted" / "room" / variant / "metrics.csv", rows)
    outcomes = collect(sorted(tmp_path.rglob("metrics.csv")))
    assert {o.variant: (o.targets["message"].psnr, o.views["message"]) for o in outcomes} == {
        "unattacked": (30.0, 1),
        "gspure": (29.0, 1),
        "black": (9.0, 1),
    }


def test_views_off_the_camera_path_replace_no_identical_ones_on_it(tmp_path: Path) -> None:
    for variant, psnrs in {"unattacked": (np.inf, 30.0), "gspure": (20.0, 25.0)}.items():
        rows = [measured("message", psnr, view=view) for view, psnr in zip(("a", "off_path_0"), psnrs, strict=True)]
        write_metrics(tmp_path / "planted" / "room" / variant / "metrics.csv", rows)
    outcomes = {o.variant: o for o in collect(sorted(tmp_path.rglob("metrics.csv")))}
    assert [outcomes[name].targets["message"].psnr for name in ("unattacked", "gspure")] == [np.inf, 20.0]
    assert outcomes["gspure"].off_path["message"].psnr == 25.0


@pytest.mark.parametrize(("black", "drop"), [({"a": np.inf}, 1.0), ({"a": np.inf, "b": 9.0}, np.nan)])
def test_photographs_that_each_equal_some_variant_are_no_reason_to_refuse(tmp_path: Path, black: dict, drop) -> None:
    views = {"unattacked": {"a": 30.0, "b": np.inf}, "gspure": {"a": 29.0, "b": 20.0}, "black": black}
    for variant, psnrs in views.items():
        rows = [measured("message", psnr, view=view) for view, psnr in psnrs.items() if view in black]
        write_metrics(tmp_path / "planted" / "room" / variant / "metrics.csv", rows)
    outcomes = {o.variant: o for o in collect(sorted(tmp_path.rglob("metrics.csv")))}
    assert outcomes["black"].level("message") == np.inf
    np.testing.assert_equal(outcomes["gspure"].psnr_drop("message"), drop)


def test_a_variant_compared_with_renders_has_no_drop_from_photographs(tmp_path: Path) -> None:
    for variant, reference in (("unattacked", TRUTH), ("gspure", RENDER)):
        rows = [measured("scene", 30.0, reference=reference, view="a")]
        write_metrics(tmp_path / "planted" / "room" / variant / "metrics.csv", rows)
    with pytest.raises(InputError, match="scene: expected reference truth, as unattacked has, found render"):
        collect(sorted(tmp_path.rglob("metrics.csv")))


def test_two_masks_or_retrievals_of_one_model_are_refused(tmp_path: Path) -> None:
    metrics, masks = results(tmp_path)[:2]
    copy = masks[0].parent / "copy" / masks[0].name
    save_array(copy, np.load(masks[0]))
    with pytest.raises(InputError, match=f"a second one beside {re.escape(str(masks[0]))}"):
        collect(metrics, [*masks, copy])
    retrievals = [tmp_path / run / "planted" / "room" / "retrieval.csv" for run in "ab"]
    for path in retrievals:
        write_table(path, Retrieved, [])
    with pytest.raises(InputError, match="one file for every model, found 2 files of 1 models"):
        collect(metrics, retrievals=retrievals)


@pytest.mark.parametrize(("place", "photographs", "warned"), [("b", "x", 1), ("b", "y", 0), ("a@1", "x", 0)])
def test_two_scenes_of_the_same_photographs_are_warned_of(tmp_path: Path, capsys, place, photographs, warned) -> None:
    metrics = [next(m for m in results(tmp_path, name)[0] if "unattacked" in str(m)) for name in ("a", place)]
    for path, digest in zip(metrics, ("x", photographs), strict=True):
        write_record(path, inputs={}, settings={"references": {"scene/0": digest}})
    outputs = ["--out", str(tmp_path / "results.csv"), "--markdown", str(tmp_path / "results.md")]
    assert main(["table", "--metrics", *map(str, metrics), *outputs]) == 0
    assert capsys.readouterr().err.count("and a have the same reference images") == warned


def test_retrieval_of_a_model_without_metrics_is_refused(tmp_path: Path) -> None:
    metrics, _, _ = results(tmp_path)
    write_table(other := tmp_path / "planted" / "vault" / "retrieval.csv", Retrieved, [])
    with pytest.raises(InputError, match="expected models with metrics, found planted/vault"):
        collect(metrics, retrievals=[other])


def test_metrics_and_retrieval_of_different_renders_are_refused(tmp_path: Path) -> None:
    folder, image = tmp_path / "planted" / "room", tmp_path / "view.png"
    metrics, retrieval = folder / "gspure" / "metrics.csv", folder / "retrieval.csv"
    write_metrics(metrics, [measured("scene", 30.0, view="a")])
    write_table(retrieval, Retrieved, [])
    for path, content in ((metrics, "first"), (retrieval, "second")):
        image.write_text(content)
        write_record(path, inputs={image.as_posix(): image}, settings={})
    with pytest.raises(InputError, match=f"^{retrieval}: {image}: expected .*, as in {metrics}"):
        collect([metrics], retrievals=[retrieval])
    write_record(metrics, inputs={image.as_posix(): image}, settings={})
    assert len(collect([metrics], retrievals=[retrieval])) == 1


@pytest.mark.parametrize("second", ["e2/planted/room", "e1/planted/room@0", "e1/planted/room"])
def test_two_files_of_one_variant_are_refused(tmp_path: Path, second: str) -> None:
    files = [tmp_path / folder / "gspure" / "metrics.csv" for folder in ("e1/planted/room", second)]
    for file in files:
        write_metrics(file, [measured("scene", 30.0, view="a")])
    with pytest.raises(InputError, match="gspure: expected one file for every variant of a model"):
        collect(files)


def test_a_table_of_two_runs_of_one_model_is_refused(tmp_path: Path) -> None:
    write_results(tmp_path / "a.csv", benchmark({"room": {"gspure": (1.0, 10.0)}}))
    header, *rows = (tmp_path / "a.csv").read_text().splitlines()
    (tmp_path / "both.csv").write_text("\n".join([header, *rows, *rows, ""]))
    with pytest.raises(InputError, match="one for every target of every variant"):
        read_results(tmp_path / "both.csv")


def test_a_condition_of_no_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="condition: expected a model with metrics, found planted/rom"):
        collect(results(tmp_path)[0], conditions={"planted/rom": ("own", "both")})


def test_a_view_listed_twice_is_refused(tmp_path: Path) -> None:
    write_metrics(tmp_path / "metrics.csv", [measured("scene", psnr, view="a") for psnr in (20.0, 30.0)])
    with pytest.raises(InputError, match="rows: expected one per target and view, found 2 of scene/a"):
        read_metrics(tmp_path / "metrics.csv")


def compared_with_renders(tmp_path: Path) -> list[Path]:
    for variant, value in (("unattacked", np.inf), ("gspure", np.inf), ("gaussian_noise", 30.0)):
        rows = [measured("scene", value, 1.0, RENDER, "1")]
        write_metrics(tmp_path / "vanilla" / "own" / variant / "metrics.csv", rows)
    return sorted(tmp_path.rglob("metrics.csv"))


def test_drops_of_the_psnr_against_renders_are_unknown(tmp_path: Path) -> None:
    """Those of identical renders, too: a mean over scenes would hold only zeros."""
    outcomes = collect(compared_with_renders(tmp_path))
    assert np.isnan([o.psnr_drop("scene") for o in outcomes]).all()
    assert [o.drops("scene")["ssim"] for o in outcomes] == [0.0, 0.0, 0.0]
    assert np.isnan([o.score for o in outcomes]).all()  # there is no message


def test_tables_count_the_identical_views_that_a_mean_leaves_out(tmp_path: Path) -> None:
    rows = [measured("scene", psnr, reference=RENDER, view=str(i)) for i, psnr in enumerate((np.inf, 30.0, np.inf))]
    write_metrics(tmp_path / "vanilla" / "own" / "gspure" / "metrics.csv", rows)
    write_results(tmp_path / "t.csv", collect([*tmp_path.rglob("metrics.csv")]))
    (row,) = csv.DictReader((tmp_path / "t.csv").read_text().splitlines())
    assert (row["psnr"], row["views"], row["identical"]) == ("30", "3", "2")
    (outcome,) = read_results(tmp_path / "t.csv")
    assert outcome.identical == {"scene": 2}


def test_drops_are_those_of_the_measured_metrics(tmp_path: Path) -> None:
    psnr = {"unattacked": 30 + 1 / 3, "gspure": 30.39104999}
    for variant, value in psnr.items():
        write_metrics(tmp_path / "vanilla" / "own" / variant / "metrics.csv", [measured("scene", value, view="1")])
    write_results(tmp_path / "t.csv", collect([*tmp_path.rglob("metrics.csv")]))
    _, gspure = read_results(tmp_path / "t.csv")
    assert gspure.psnr_drop("scene") == psnr["unattacked"] - psnr["gspure"]


def test_tables_name_the_reference(tmp_path: Path) -> None:
    outcomes = collect([*compared_with_renders(tmp_path), *results(tmp_path)[0]])
    write_results(tmp_path / "t.csv", outcomes)
    rows = list(csv.DictReader((tmp_path / "t.csv").read_text().splitlines()))
    assert {(row["scheme"], row["reference"]) for row in rows} == {("planted", "truth"), ("vanilla", "render")}
    assert next(row["psnr"] for row in rows if row["scheme"] == "vanilla") == "inf"
    planted, vanilla = [[o for o in outcomes if o.scheme == scheme] for scheme in ("planted", "vanilla")]
    assert shown(vanilla)["unattacked"]["scene PSNR"] == "∞"
    assert "photographs" not in model_table(vanilla).note
    assert shown(planted)["unattacked"]["scene PSNR"] == "28.00"
    assert "photographs" in model_table(planted).note


def test_command_writes_one_row_per_target_and_a_table_to_read(tmp_path: Path, capsys) -> None:
    metrics, masks, truth = results(tmp_path)
    out, text = tmp_path / "results.csv", tmp_path / "results.md"
    verdicts = []
    for path in metrics:
        verdicts.append(path.with_name("verdict.json"))
        write_json(verdicts[-1], {"reached": {"message": "noise" not in path.parent.name}, "strength": "tau=4"})
    arguments = ["--metrics", *metrics, "--prune-masks", *masks, "--keys", truth.parent, "--out", out]
    arguments += ["--markdown", text, "--verdicts", *verdicts]
    assert main(["table", *map(str, arguments)]) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert len(rows) == 6
    ours = next(row for row in rows if (row["variant"], row["target"]) == ("gspure", "message"))
    assert ours == {
        "scheme": "planted",
        "protocol": "",
        "initialization": "",
        "scene": "room",
        "variant": "gspure",
        "target": "message",
        "reference": "truth",
        "views": "2",
        "identical": "0",
        **dict.fromkeys(METRICS, "0.8"),
        **{f"{name}_drop": "0" for name in METRICS},
        "psnr": "10",
        "psnr_drop": "14",
        "score": "13",
        "pruned_share": "0.4",
        "reached": "true",
        "strength": "tau=4",
        "failure": "",
        **dict.fromkeys((*(f"off_path_{name}" for name in METRICS), "off_path_psnr_drop", "off_path_score"), ""),
        **dict.fromkeys((f"retrieval_{name}" for name in Retrieval._fields), ""),
        **dict.fromkeys((f"detection_{name}" for name in Detection._fields), ""),
        "seed": "0",
        "precision": "0.5",
        "recall": "0.5",
    }
    assert text.read_text() == results_markdown(read_results(out))
    cells = shown(read_results(out))
    pruning = {"strength": "tau=4", "pruned": "40.0%", "precision": "50.0%", "recall": "50.0%"}
    assert cells["GSPure"].items() >= {"message PSNR": "10.00 (−14.00)", "Score message": "+13.00", **pruning}.items()
    noise = {"message PSNR": "23.00 (−1.00)", "pruned": "0.0%", "precision": "–"}  # reached, whatever the verdict says
    assert cells["Gaussian noise"].items() >= noise.items()
    assert capsys.readouterr().err.count("gaussian_noise: the extraction message changed, although no column") == 1


def test_unknown_numbers_are_empty_cells(tmp_path: Path) -> None:
    metrics, _, _ = results(tmp_path)
    outcomes = collect(metrics[:1])
    write_results(tmp_path / "t.csv", outcomes)
    row = next(csv.DictReader((tmp_path / "t.csv").read_text().splitlines()))
    of_target = {"scheme", "scene", "seed", "variant", "target", "reference", "views", "identical"}
    assert {name for name, cell in row.items() if cell} == {*of_target, *METRICS}
    assert "nan" not in results_markdown(outcomes)


def test_a_table_of_ones_own_may_have_no_metric_but_psnr(tmp_path: Path) -> None:
    write_results(table := tmp_path / "t.csv", collect(results(tmp_path)[0]))
    rows = list(csv.DictReader(table.read_text().splitlines()))
    others = {name for name in rows[0] if name.removesuffix("_drop") in METRICS.keys() - {"psnr"}}
    with (own := tmp_path / "own.csv").open("w") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows([row | dict.fromkeys(others, "") for row in rows])
    outputs = [f"--{name}={tmp_path}/{name}.csv" for name in ("out", "survival", "matched")]
    assert main(["contest", "--table", str(own), *outputs, f"--markdown={tmp_path}/c.md"]) == 0
    assert main(["report", "--table", str(own), f"--out={tmp_path}/r.html"]) == 0
    assert [o.score for o in read_results(own)] == [o.score for o in read_results(table)]


def test_masks_of_different_models_are_refused(tmp_path: Path) -> None:
    metrics, masks, truth = results(tmp_path)
    np.save(truth, np.zeros(6, bool))
    with pytest.raises(InputError, match=r"message_rows\.npy: array: expected bool \[5\], found bool \[6\]"):
        collect(metrics, masks, [truth])


def test_a_missing_table_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        collect([tmp_path / "a" / "b" / "c" / "metrics.csv"])


def judged(metrics: list[Path]) -> list[Path]:
    """Verdicts: noise did not reach the message."""
    files = [path.with_name("verdict.json") for path in metrics]
    for path in files:
        write_json(path, {"reached": {"message": "noise" not in path.parent.name}, "strength": "tau=4"})
    return files


def test_an_attack_that_did_not_reach_the_carrier_is_marked(tmp_path: Path) -> None:
    metrics, _, _ = results(tmp_path)
    rows = [row for path in metrics if path.parent.name == "unattacked" for row in read_metrics(path)]
    write_metrics(next(path for path in metrics if path.parent.name == "gaussian_noise"), rows)
    outcomes = collect(metrics, verdicts=judged(metrics))
    marked = [name for name, cells in shown(outcomes).items() if "†" in "".join(cells.values())]
    assert marked == ["Gaussian noise"]
    assert "†" in model_table(outcomes).note
    write_results(tmp_path / "t.csv", outcomes)
    assert [o.reached for o in read_results(tmp_path / "t.csv")] == [o.reached for o in outcomes]


def failed_job(tmp_path: Path, metrics: list[Path], reason: str) -> Path:
    """The status of a job without which there are no such metrics."""
    log = str(tmp_path / "attack.log")
    Failure("attack_model", reason, log, "run.log", [str(tmp_path / "prune_mask.npy"), *map(str, metrics)]).write()
    return status_of(log)


def test_a_failed_variant_has_its_reason_instead_of_numbers(tmp_path: Path) -> None:
    metrics, _, _ = results(tmp_path)
    noise = [path for path in metrics if "noise" in str(path)]
    status = failed_job(tmp_path, noise, "no colour: a, b")
    finished = [path for path in metrics if path not in noise]
    outcomes = collect(finished, verdicts=judged(finished), failures=[status])
    failed = next(o for o in outcomes if o.variant == "gaussian_noise")
    assert not failed.targets
    assert np.isnan(failed.score)
    text = results_markdown(outcomes)
    (sentence,) = (line for line in text.splitlines() if "no colour: a, b" in line)
    assert "Gaussian noise on Planted message, room" in sentence
    assert "Gaussian noise" not in shown(outcomes)
    write_results(tmp_path / "t.csv", outcomes)
    again = read_results(tmp_path / "t.csv")
    assert [(o.variant, o.failure) for o in again] == [(o.variant, o.failure) for o in outcomes]
    assert [sorted(o.targets) for o in again] == [sorted(o.targets) for o in outcomes]


def test_views_beside_the_path_are_averaged_on_their_own(tmp_path: Path) -> None:
    metrics, _, _ = results(tmp_path)
    for path in metrics:
        rows = read_metrics(path)
        aside = [row._replace(view=f"off_path_{row.view}", values={**row.values, "psnr": row.psnr - 5}) for row in rows]
        write_metrics(path, [*rows, *(row for row in aside if row.view.endswith("0"))])
    outcomes = collect(metrics)
    ours = next(o for o in outcomes if o.variant == "gspure")
    assert (ours.targets["message"].psnr, ours.off_path["message"].psnr) == (10.0, 6.0)
    assert (ours.views["message"], ours.score, ours.off_path_outcome().score) == (2, 13.0, 13.0)
    assert shown(outcomes)["GSPure"]["PSNR off path message"] == "6.00"
    write_results(tmp_path / "t.csv", outcomes)
    assert [o.off_path for o in read_results(tmp_path / "t.csv")] == [o.off_path for o in outcomes]
    summary = next(row for row in summarize(outcomes) if row.variant == "gspure")
    assert [mean.mean for mean in (summary.off_path_scene, summary.off_path_message, summary.off_path_score)] == [
        24,
        6,
        13,
    ]


def test_a_table_of_nothing_but_failures_is_refused(tmp_path: Path) -> None:
    metrics, _, _ = results(tmp_path)
    status = failed_job(tmp_path, metrics, "no room")
    with pytest.raises(InputError, match=r"expected metrics of some variant, found none: .*no room"):
        collect([], failures=[status])


def test_repetitions_of_a_scene_are_averaged_within_it(tmp_path: Path) -> None:
    first, _, _ = results(tmp_path)
    shutil.copytree(first[0].parents[1], repeated := first[0].parents[2] / "room@1")
    outcomes = collect([*first, *sorted(repeated.glob("*/metrics.csv"))])
    assert [(o.scene, o.seed, o.folder) for o in outcomes][::3] == [("room", 0, "room"), ("room", 1, "room@1")]
    write_results(tmp_path / "t.csv", outcomes)
    assert [o.folder for o in read_results(tmp_path / "t.csv")] == [o.folder for o in outcomes]
    assert {row.scene.scenes for row in summarize(outcomes) if row.scene} == {1}
    assert "## Planted message, room, repetition 1" in results_markdown(outcomes)


def test_a_file_that_is_not_a_verdict_is_refused(tmp_path: Path) -> None:
    metrics, _, _ = results(tmp_path)
    write_json(metrics[0].with_name("verdict.json"), {"reached": {"message": "yes"}})
    with pytest.raises(InputError, match=r"verdict\.json: file: expected the verdict of an attack"):
        collect(metrics, verdicts=[metrics[0].with_name("verdict.json")])


def test_controls_have_no_score_and_other_extractions_one_of_their_own(tmp_path: Path) -> None:
    for variant, (scene, message, oracle) in {
        "unattacked": (30, 25, 28),
        "gspure": (29, 12, 20),
        "wrong_key": (30, 9, 9),
    }.items():
        rows = [measured("scene", scene, view="0"), measured("message", message, 0.8, view="0")]
        rows += [measured("message_oracle", oracle, 0.8, view="0")]
        write_metrics(tmp_path / "sis" / "room" / variant / "metrics.csv", rows)
    outcomes = {o.variant: o for o in collect(sorted(tmp_path.rglob("metrics.csv")))}
    assert outcomes["gspure"].messages == ["message", "message_oracle"]
    assert (outcomes["gspure"].score, outcomes["gspure"].score_of("message_oracle")) == (12.0, 7.0)
    assert outcomes["wrong_key"].is_control
    assert np.isnan(outcomes["wrong_key"].score)
    cells = shown([*outcomes.values()])
    assert (cells["GSPure"]["Score message"], cells["GSPure"]["Score message (oracle)"]) == ("+12.00", "+7.00")
    assert cells["wrong key"]["Score message"] == "–"


def test_a_new_metric_is_a_column_of_every_file_and_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def mean_error(a, b) -> float:
        return float(np.mean(np.abs(a - b)))

    monkeypatch.setitem(METRICS, "mae", Metric(mean_error, "MAE", 3))
    for name, brightness in (("truth", 0.2), ("unattacked", 0.2), ("gspure", 0.6)):
        write_image(tmp_path / name / "scene" / "1.png", np.full((16, 16, 3), brightness))
    for name in ("unattacked", "gspure"):
        pairs, _ = pair_images(tmp_path / "truth", tmp_path / name)
        write_metrics(tmp_path / "vanilla" / "room" / name / "metrics.csv", map(compare, pairs))
    outcomes = collect(sorted(tmp_path.rglob("metrics.csv")))
    write_results(tmp_path / "results.csv", outcomes)
    row = list(csv.DictReader((tmp_path / "results.csv").read_text().splitlines()))[1]
    assert (float(row["mae"]), float(row["mae_drop"])) == pytest.approx((0.4, -0.4))
    assert shown(read_results(tmp_path / "results.csv"))["GSPure"]["scene MAE"] == "0.400"
