"""The workflow run once, killed on the way and started again by `make demo`; what changes run; shipped settings."""

import csv
import os
import re
import shutil
import signal
import subprocess
import time

import numpy as np
import pytest
import yaml

import gspure
from gspure.cli import main
from gspure.datasets import SCENES
from gspure.model import read_model
from gspure.workflow import auditing
from gspure.workflow.config import DEFAULT_VARIANTS
from tests.training_cases import colmap_project, ring
from tests.workflow_cases import CONFIG, PRINTED, ROOT, edit_cameras, make_ready, started

pytestmark = pytest.mark.workflow

BOT = "results/vanilla/bot"
FAILED = 2  # models whose variant `broken` fails, in every run again
AGAIN = {"evaluate_variant": FAILED, "write_report": 1, "all": 1}


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """A project in which `make demo` was killed with its whole process group, and started again."""
    project = started(tmp_path_factory.mktemp("demo") / "project")
    make_ready(project)
    command = ["make", "demo"]
    with subprocess.Popen(
        command, cwd=project.folder, env=project.environment(), **PRINTED, start_new_session=True
    ) as run:
        deadline = time.monotonic() + 120
        while not [*project.folder.glob("results/logs/*/*/weights.log")]:
            assert run.poll() is None, run.stdout.read()
            assert time.monotonic() < deadline
            time.sleep(0.05)
        refused = subprocess.run(command, cwd=project.folder, env=project.environment(), **PRINTED, check=False)
        os.killpg(run.pid, signal.SIGKILL)
    assert "expected no other run here, found one that runs" in refused.stdout
    assert any(project.folder.glob(".snakemake/locks/*"))
    again = subprocess.run(command, cwd=project.folder, env=project.environment(), **PRINTED, check=False)
    (project.folder / "again.log").write_text(again.stdout)
    return project


@pytest.fixture
def project(tmp_path, finished):
    return finished.copy(tmp_path / "project")


@pytest.fixture(scope="session")
def rows(finished):
    with (finished.folder / "results/tables/results.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def planned(project, *arguments):
    """The jobs that would run beside those of the failed variant."""
    jobs = project.planned(*arguments)
    jobs.subtract(AGAIN | {"total": sum(AGAIN.values())})
    return {rule: count for rule, count in jobs.items() if count}


def test_a_killed_run_continues_and_leaves_no_half_file(finished):
    log = (finished.folder / "again.log").read_text()
    assert "an earlier run was killed: what it left undone is done now\n" in log  # after lines of an outer make
    assert {path.name for path in finished.folder.glob("results/**/.*")} == {".snakemake_timestamp"}
    assert planned(finished) == {}


def test_a_failed_variant_fails_alone_and_is_named_with_its_reason(finished, rows):
    reasons = {(row["scheme"], row["variant"]): row["failure"] for row in rows}
    assert reasons["vanilla", "gspure"] == reasons["planted", "gspure"] == ""
    assert "attributes" in reasons["vanilla", "broken"]
    assert "attributes" in (finished.folder / "results/report.html").read_text()
    log = (finished.folder / "again.log").read_text()
    assert re.search("^Evaluating broken of bot failed: gspure evaluate: .*attributes", log, re.MULTILINE)
    assert "demo] Error 2\n" in log  # not the status of a lost message; an outer make prints a line after it


def test_an_attack_that_cannot_apply_is_an_outcome(finished, rows):
    assert not [*finished.folder.glob("results/*/*/crop_all/public/*.ply")]
    reasons = {row["failure"] for row in rows if row["variant"] == "crop_all"}
    assert reasons == {f"not applicable: none of {count} rows would remain" for count in (300, 600)}
    assert "crop_all" not in re.findall(r"Error in rule.*", (finished.folder / "again.log").read_text())


def test_a_marked_model_with_its_key_has_the_metrics_of_its_pair(project):
    for part in ("public", "key"):
        shutil.copytree(project.folder / "results/planted/raised" / part, project.folder / "mine" / part)
    pair = "results/pairs/raised"
    asset = {"model": "mine/public", "cameras": f"{pair}/cameras.json", "key": "mine/key", "message": f"{pair}/message"}
    project.configure({name: value for name, value in CONFIG.items() if name != "pairs"} | {"assets": {"mine": asset}})
    project.run("results/planted/mine/gspure/metrics.csv")
    mine, raised = (project.folder / f"results/planted/{name}/gspure/metrics.csv" for name in ("mine", "raised"))
    assert mine.read_text() == raised.read_text()


def test_metrics_and_evidence_of_variants_are_in_the_table(rows):
    gspure = {(row["scheme"], row["extraction"]): row for row in rows if row["variant"] == "gspure"}
    assert {*gspure} == {("vanilla", "mark"), ("planted", "mark"), ("planted", "message")}
    assert all(float(row["scene_psnr"]) > 0 for row in gspure.values())
    assert gspure["vanilla", "mark"]["reading"] == "0.5"
    before = next(row for row in rows if row["extraction"] == "message" and row["variant"] == "unattacked")
    assert (before["candidates"], before["p"], before["level"], before["word"]) == ("19", "0.05", "0.05", "proven")
    assert float(gspure["planted", "message"]["legibility"]) < float(before["legibility"])


def test_an_edited_camera_costs_one_view(project):
    edit_cameras(project, lambda cameras: cameras[1].update(fx=30.0))
    jobs = planned(project)
    assert jobs["prepare_cameras"] == jobs["measure_contributions"] == jobs["accumulate_weights"] == 1
    assert not {"make_pair", "embed_message", "evaluate_controls"} & jobs.keys()
    cached = {*project.folder.glob("stages/vanilla/bot/contributions/*")}
    project.run(f"{BOT}/weights.npy")
    (new,) = {*project.folder.glob("stages/vanilla/bot/contributions/*")} - cached
    assert new.name.startswith("view_1.")


def test_braces_in_the_name_of_a_model_are_no_wildcards(project):
    shutil.copy(project.folder / "bot.ply", project.folder / "b{1}.ply")
    project.configure({**CONFIG, "assets": {"bot": {"model": "b{1}.ply", "cameras": "views.json"}}})
    assert planned(project)["measure_contributions"] == 1


def test_a_setting_of_an_attack_concerns_its_variant_alone(project):
    config = {**CONFIG, "variants": {**CONFIG["variants"], "crop_all": {"attack": "crop", "fraction": 1e-8}}}
    project.configure(config)
    assert planned(project) == {"evaluate_variant": 2, "total": 2}


@pytest.mark.parametrize(
    ("file", "before", "after", "jobs"),
    [
        ("rules/steps/decision.py", "\ndef", "\n# edited\ndef", {"decide_pruning": 2}),
        ("kernels_cl/blending.cl", "//", "// edited", {"measure_contributions": 2}),
        ("rules/steps/candidates.py", "\ndef", "\n# edited\ndef", {"trace_candidates": 1, "evaluate_variant": 4}),
        ("mark.py", "0.5", "0.25", {"evaluate_variant": 8}),
    ],
)
def test_an_edit_runs_again_what_it_concerns(project, file, before, after, jobs):
    project.edit(file, before, after)
    assert planned(project).items() >= jobs.items()


def test_the_number_of_parts_changes_no_weight_and_computes_no_view(project):
    before, cached = (project.folder / BOT / "weights.npy").read_bytes(), [*project.folder.glob("stages/**/*.npy")]
    project.configure({**CONFIG, "views": {"parts": 3}})
    project.run(f"{BOT}/weights.npy")
    assert (project.folder / BOT / "weights.npy").read_bytes() == before
    assert [*project.folder.glob("stages/**/*.npy")] == cached


def test_a_users_model_has_the_weights_of_purify(finished, tmp_path, monkeypatch):
    monkeypatch.chdir(finished.folder)
    command = "purify bot.ply --cameras views.json --min-samples 3 --min-cluster-size 5 --out"
    assert main([*command.split(), str(tmp_path / "out")]) == 0
    for name in ("weights.npy", "prune_mask.npy"):
        found, expected = np.load(finished.folder / BOT / name), np.load(tmp_path / "out" / name)
        np.testing.assert_array_equal(found, expected)
    pruned = read_model(finished.folder / BOT / "gspure/public/point_cloud.ply")
    assert len(pruned) == len(read_model(tmp_path / "out" / "purified.ply"))


def test_an_audit_in_python_returns_results_and_is_silent(project, rows, monkeypatch, capfd):
    monkeypatch.chdir(project.folder)
    monkeypatch.setattr(auditing, "snakefile", lambda: project.folder / "Snakefile")
    audit = gspure.audit("config/config.yaml", cores=2)
    assert capfd.readouterr() == ("", "")
    assert audit.folder == project.folder / "results"
    assert [(row.variant, row.word, row.failure) for row in audit.results] == [
        (row["variant"], row["word"], row["failure"]) for row in rows
    ]
    for radii in (audit.radii, audit.model_radii):
        assert ("published", "message", "message") in {(one.owner, one.extraction, one.kind) for one in radii}
    with pytest.raises(gspure.InputError, match=r"^none\.yaml: audit: .*none\.yaml"):
        gspure.audit("none.yaml")


def test_the_grid_of_the_paper_has_a_job_per_model_and_variant_never_one_per_view(tmp_path):
    project = started(tmp_path / "project")
    for name in SCENES:  # small ones
        colmap_project(project.folder / "data" / name, ring(9), [[0.1 * i, 0.0, 0.0] for i in range(9)])
    config = yaml.safe_load((ROOT / "experiments" / "mipnerf360.yaml").read_text())
    project.configure(config)
    messages = {pair["message"] for pair in config["pairs"].values()}
    models, variants = len(config["pairs"]) * len(config["schemes"]), len(DEFAULT_VARIANTS)
    jobs = project.planned()
    once = ["embed_message", "train_clean_model", "prepare_cameras_of_pair", "accumulate_weights", "span_tree"]
    once += ["decide_pruning", "measure_surface", "draw_model", "evaluate_controls"]
    expected = {"make_pair": 9, "train_message": len(messages), "write_report": 1}
    expected |= dict.fromkeys(once, models)
    expected["measure_contributions"] = config["views"]["parts"] * models
    expected["evaluate_variant"] = variants * models
    assert jobs.items() >= expected.items()
    assert "train_model" not in jobs
    assert jobs["total"] < 35 * models
