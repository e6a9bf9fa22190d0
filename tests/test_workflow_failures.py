"""Runs in which jobs fail: what is left of them, what they say, and what the next run does."""

import csv
import os
import re
import signal
import subprocess
import sys

import numpy as np
import pytest
import yaml

from gspure.artifacts import read_json
from gspure.failures import failures_below
from gspure.images import read_image
from gspure.model import read_model
from tests.test_workflow import CONFIG, OMEGA, SLOW_WRITES, TABLE, Project, checkout, planned, started  # noqa: F401

pytestmark = pytest.mark.workflow

SLOW_NOTES = """
import time
from pathlib import Path
from gspure.workflow import notes
write_note = notes.write_note
def slow(*arguments):
    Path("noting").touch()
    time.sleep(1)
    write_note(*arguments)
notes.write_note = slow
"""
BROKEN = {"model": "broken.ply", "cameras": "views.json"}
VARIANTS = {**CONFIG["variants"], "crop": {"fraction": 1e-9}, "random_pruning": {}}
KILLED = "import os, sys\nif 'random_pruning' in sys.argv: os.kill(os.getpid(), 9)\n"
FAILED = {
    **{("broken", variant): "broken.ply: element vertex" for variant in VARIANTS},
    ("bot", "crop"): "attack crop: ",
    **{(scene, "random_pruning"): "ended by SIGKILL" for scene in ("bot", "broken")},
}


@pytest.fixture(scope="module")
def failed(tmp_path_factory, started):  # noqa: F811
    """A project with a broken model, an attack that refuses and one that is killed; and what its run printed."""
    project = started.copy(tmp_path_factory.mktemp("failed") / "project")
    (project.folder / "broken.ply").write_bytes((project.folder / "bot.ply").read_bytes()[:-7])
    (killing := tmp_path_factory.mktemp("killing")).joinpath("sitecustomize.py").write_text(KILLED)
    project.configure({**CONFIG, "assets": {**CONFIG["assets"], "broken": BROKEN}, "variants": VARIANTS})
    return project, Project(project.folder, project.checkout, (killing,)).run(status=1)


def rows(project):
    with (project.folder / TABLE).open() as table:
        return {(row["scene"], row["variant"]): row for row in csv.DictReader(table)}


def test_the_tables_have_numbers_of_finished_cells_and_reasons_of_failed_ones(failed):
    found = rows(failed[0])
    assert {cell for cell, row in found.items() if row["failure"]} == FAILED.keys()
    assert all(reason in found[cell]["failure"] for cell, reason in FAILED.items())
    assert all(row["psnr"] for cell, row in found.items() if cell not in FAILED)


def test_the_report_names_every_reason(failed):
    page = (failed[0].folder / "results" / "report.html").read_text()
    assert all(reason in page for reason in FAILED.values())


def test_every_file_is_what_its_name_says(failed):
    files = [path for path in (failed[0].folder / "results").rglob("*") if path.is_file()]
    readers = {".npy": np.load, ".ply": read_model, ".png": read_image, ".json": read_json}
    assert {path.suffix for path in files} >= readers.keys()
    for path in files:
        if path.suffix in readers:
            readers[path.suffix](path)
    cells = {path.parent.parts[-2:] for path in files if path.name in ("metrics.csv", "prune_mask.npy")}
    assert cells
    assert not cells & FAILED.keys()


def test_a_failed_job_has_a_status_with_reason_and_log(failed):
    project, _ = failed
    statuses = failures_below(project.folder / "results" / "logs")
    assert {status.rule for status in statuses} == {"attack_model", "measure_contributions", "measure_opacities"}
    for status in statuses:
        assert (project.folder / status.log).read_text()
        assert not any((project.folder / path).exists() for path in status.missing)


def test_the_last_lines_name_the_failures_and_the_command_to_try_again(failed):
    project, printed = failed
    last = printed.rpartition("At least one job did not complete successfully.")[2]
    assert all(status.reason in last for status in failures_below(project.folder / "results" / "logs"))
    assert re.search(r"^To try again: snakemake .*--configfile config.yaml\n\Z", last, re.MULTILINE)


def test_an_audit_shows_jobs_and_failures_and_keeps_the_lines_of_snakemake_in_a_log(tmp_path, started):  # noqa: F811
    project = started.copy(tmp_path / "project")
    project.configure({**CONFIG, "variants": {"unattacked": {}, "gspure": {}, "crop": {"fraction": 1e-9}}})
    command = [sys.executable, "-m", "gspure", "audit", "config.yaml", "--cores", "2"]
    done = subprocess.run(
        command, cwd=project.folder, env=project.environment(), capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert not done.stdout
    lines = done.stderr.splitlines()
    assert any(re.fullmatch(r"job \d+ of \d+, 0:\d\d:\d\d: Attacking vanilla/bot: crop", line) for line in lines)
    assert "failed: Attacking vanilla/bot: crop (results/logs/vanilla/bot/crop/attack.log)" in lines
    *_, reason, variants, log, again = lines
    assert "crop: rows: expected" in reason
    assert variants == "Without results: vanilla/bot: crop"
    assert "Select jobs to execute" in (project.folder / log.removeprefix("Snakemake's log: ")).read_text()
    assert again == "To try again: gspure audit config.yaml --cores 2"


def test_the_next_run_tries_failed_jobs_again_and_finished_ones_not(failed):
    jobs = planned(failed[0].run("--dry-run"))
    assert jobs["attack_model"] == len(FAILED)
    assert jobs["measure_contributions"] == jobs["tabulate_metrics"] == jobs["write_report"] == 1


def test_a_successful_run_removes_the_records_of_failures(failed, tmp_path):
    project = failed[0].copy(tmp_path / "project")
    mended = bytearray((project.folder / "bot.ply").read_bytes())
    mended[-4] ^= 1  # no asset may be equal to another one
    (project.folder / "broken.ply").write_bytes(mended)
    config = yaml.safe_load((project.folder / "config.yaml").read_text())
    config["variants"]["crop"] = {}
    project.configure(config)
    project.run()
    assert all(row["psnr"] and not row["failure"] for row in rows(project).values())
    assert not failures_below(project.folder / "results")
    assert "Nothing to be done" in project.run()


def test_without_a_finished_cell_there_is_no_table_and_the_report_is_named_as_of_an_earlier_run(failed, tmp_path):
    project = failed[0].copy(tmp_path / "project")
    project.configure({**CONFIG, "assets": {"broken": BROKEN}})
    printed = project.run(status=1)
    assert "metrics of some variant" in printed
    assert "Of an earlier run: results/report.html" in printed.splitlines()
    assert not (project.folder / TABLE).exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["interrupted", "terminated"])
def test_a_stopped_run_makes_no_tables_and_has_no_failures(tmp_path, started, number):  # noqa: F811
    project = started.copy(tmp_path / "project")
    with project.started(TABLE, SLOW_WRITES, project.stages) as run:
        os.killpg(run.pid, number)
        assert run.wait(60) != 0
    printed = (project.folder / "run.log").read_text()
    assert "tabulate_metrics" not in printed.partition("Terminating processes")[2]
    assert not failures_below(project.folder / "results")
    project.run(OMEGA)


def test_a_run_that_is_terminated_while_it_writes_a_note_ends(tmp_path, started):  # noqa: F811
    project = started.copy(tmp_path / "project")
    with project.started(TABLE, SLOW_NOTES, (project.folder / "noting").exists) as run:
        run.terminate()
        assert run.wait(60) != 0
    assert not (project.folder / TABLE).exists()


def test_a_scheme_without_its_package_is_refused_before_any_job(tmp_path, checkout):  # noqa: F811
    (tmp_path / "absent").mkdir()
    (tmp_path / "absent" / "sitecustomize.py").write_text("import sys\nsys.modules['torch'] = None\n")
    project = Project(tmp_path, checkout, packages=(tmp_path / "absent",))
    pair = {"views": 9, "width": 32, "height": 24}
    project.configure({"pairs": {"pair": pair}, "schemes": {"gs_hider": {}}})
    lines = project.run(status=2).splitlines()
    assert lines[-1].startswith("gspure: scheme gs_hider: package: expected torch")
    assert "pip install gspure[torch]" in lines[-1]
    assert not (tmp_path / "results").exists()


def test_without_the_device_that_is_named_no_job_is_started(tmp_path, started):  # noqa: F811
    project = started.copy(tmp_path / "project")
    project.configure({**CONFIG, "device": "nonsuch"})
    assert (
        project.run(status=2).splitlines()[-1].startswith("gspure: OpenCL: device: expected one that matches 'nonsuch'")
    )
    assert not (project.folder / "results").exists()
