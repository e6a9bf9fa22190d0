"""``gspure audit``: the workflow on a model or a configuration, in the current folder."""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from gspure.cli import main
from gspure.cli.audit import snakefile
from gspure.constants import ANCHOR_TAU_C, ANCHOR_TAU_N
from gspure.model import Gaussians, write_model
from gspure.workflow.configuration import resolved, validated
from tests.documentation import ROOT
from tests.models import blobs


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_model(tmp_path / "my model.ply", blobs(30))
    return tmp_path


@pytest.fixture
def words(monkeypatch):
    """The command line of Snakemake, which is not started."""
    started = []
    monkeypatch.setattr(os, "execve", lambda program, command, environment: started.extend(command) or 0)
    monkeypatch.setattr(subprocess, "call", lambda command: started.extend(command) or 0)
    return started


def test_a_model_becomes_a_configuration_that_the_workflow_accepts(folder, words):
    Path("audit").mkdir()
    assert main(["audit", "my model.ply", "--cameras", "orbit", "--up", "0", "0", "1"]) == 0
    file = Path(words[words.index("--configfile") + 1])
    schema = snakefile().parent / "schemas" / "config.schema.yaml"
    config = resolved(validated(yaml.safe_load(file.read_text()), schema, file), file)
    (asset,) = config["assets"].values()
    assert (asset["model"], asset["cameras"], asset["generated"]["up"]) == ("my model.ply", "orbit", [0, 0, 1])
    assert Path(words[words.index("--snakefile") + 1]) == ROOT / "Snakefile"


def test_anchors_are_pruned_with_the_factors_of_purify(folder, words):
    anchors = np.zeros(3, [(name, "<f4") for name in (*blobs(1).table.dtype.names, "f_anchor_feat_0", "f_offset_0")])
    write_model(folder / "anchors.ply", Gaussians(anchors))
    assert main(["audit", "anchors.ply", "--cameras", "orbit"]) == 0
    assert main(["audit", "anchors.ply", "--cameras", "orbit"]) == 0  # which finds its own configuration
    config = yaml.safe_load(Path(words[words.index("--configfile") + 1]).read_text())
    assert config["method"] == {"tau_c": ANCHOR_TAU_C, "tau_n": ANCHOR_TAU_N}


@pytest.mark.parametrize("name", ["model", "figures", "stages", "results"])
def test_the_name_of_a_model_changes_no_job(folder, name):
    jobs = []
    for file in (name, "other"):
        write_model(folder / f"{file}.ply", blobs(30))
        command = [sys.executable, "-m", "gspure", "audit", f"{file}.ply", "--cameras", "orbit", "--dry-run"]
        printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        jobs.append(dict(re.findall(r"^(\w+) +(\d+)$", printed, re.MULTILINE)))
    assert jobs[0] == jobs[1]
    assert jobs[0]["write_report"] == "1"


def test_an_unpacked_sog_is_named_after_its_folder(folder, words):
    Path("robot").mkdir()
    Path("robot/meta.json").touch()
    assert main(["audit", "robot/meta.json", "--cameras", "orbit"]) == 0
    assert list(yaml.safe_load(Path("results/audit.yaml").read_text())["assets"]) == ["robot"]


def test_a_configuration_is_used_as_it_is_and_further_options_reach_snakemake(folder, words):
    Path("mine.yaml").write_text("assets: {}")
    assert main(["audit", "mine.yaml", "--cores", "3", "-n", "--", "--forcerun", "render_scene", "--cores"]) == 0
    assert "snakemake" in words[2]
    assert words[words.index("--configfile") + 1] == "mine.yaml"
    assert words[words.index("--cores") + 1] == "3"
    assert "--dry-run" in words
    assert words[-3:] == ["--forcerun", "render_scene", "--cores"]
    assert not Path("results").exists()


def test_a_target_is_no_second_configuration(folder, words):
    Path("mine.yaml").write_text("assets: {}")
    assert main(["audit", "mine.yaml", "--", "purified"]) == 0
    assert words[-1] == "purified"
    assert words[words.index("--configfile") + 2].startswith("--")


def test_snakemake_is_silent_about_the_default_profile_but_names_other_ones(folder):
    def planned(*further):
        command = [sys.executable, "-m", "gspure", "audit", "my model.ply", "--cameras", "orbit", "-n", *further]
        return subprocess.run(command, capture_output=True, text=True, check=True).stderr

    assert "profile" not in planned()
    Path("profiles/default").mkdir(parents=True)
    Path("profiles/default/config.yaml").write_text("cores: 1\n")
    assert "Using workflow specific profile" in planned()


def test_the_options_of_the_default_profile_are_its_settings(folder, words):
    assert main(["audit", "my model.ply", "--cameras", "orbit"]) == 0
    parser = argparse.ArgumentParser()
    for name in ("workflow-profile", "cores", "scheduler"):
        parser.add_argument(f"--{name}")
    for name in ("resources", "quiet"):
        parser.add_argument(f"--{name}", nargs="+")
    for name in ("keep-going", "rerun-incomplete", "show-failed-logs"):
        parser.add_argument(f"--{name}", action="store_true")
    options = vars(parser.parse_known_args(words)[0])
    profile = yaml.safe_load((snakefile().parent / "profiles" / "default" / "config.yaml").read_text())
    assert options == {"workflow_profile": "none"} | {name.replace("-", "_"): value for name, value in profile.items()}


def test_a_dry_run_of_a_model_leaves_the_configuration_of_the_last_audit(folder, monkeypatch):
    audit, configurations = ["audit", "my model.ply", "--cameras"], []

    def start(command):
        configurations.append(Path(command[command.index("--configfile") + 1]).read_text())
        return 0

    monkeypatch.setattr(os, "execve", lambda program, command, environment: start(command))
    monkeypatch.setattr(subprocess, "call", start)
    assert main([*audit, "orbit", "--dry-run"]) == 0
    assert not Path("results").exists()
    assert main([*audit, "orbit"]) == main([*audit, "shells", "--dry-run"]) == 0
    assert [yaml.safe_load(text)["assets"]["my_model"]["cameras"] for text in configurations] == [
        "orbit",
        "orbit",
        "shells",
    ]
    assert "orbit" in Path("results/audit.yaml").read_text()


@pytest.mark.parametrize("option", ["--dry-run", "--dryrun", "-n", "-np"])
def test_a_dry_run_that_snakemake_is_asked_for_writes_nothing(folder, words, option):
    assert main(["audit", "my model.ply", "--cameras", "orbit", "--", option]) == 0
    assert words[-1] == option
    assert not Path("results").exists()


def test_the_results_of_another_model_are_not_replaced(folder, words, capsys):
    audit = ["audit", "my model.ply", "--cameras", "orbit"]
    assert main(audit) == main(["audit", str(Path("my model.ply").resolve()), "--cameras", "shells"]) == 0
    assert main(audit) == 0
    first = Path("results/audit.yaml").read_text()
    Path("other").mkdir()
    write_model(Path("other/my model.ply"), blobs(20))
    write_model(Path("other.ply"), blobs(20))
    for model in ("other/my model.ply", "other.ply"):
        assert main(["audit", model, "--cameras", "orbit"]) == 2
        assert "audit in another folder" in capsys.readouterr().err
        assert Path("results/audit.yaml").read_text() == first
    for edited in (
        f"{first}variants: {{unattacked: {{}}}}\n",
        f"{first}method: {{tau_c: 2}}\n",
        "assets: {}\n",
        "7\n",
        "[",
    ):
        Path("results/audit.yaml").write_text(edited)
        assert main(audit) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
        assert Path("results/audit.yaml").read_text() == edited


def test_an_audit_that_is_refused_writes_nothing(folder, words, capsys):
    Path("my model.ply").rename("my {model}.ply")
    assert main(["audit", "my {model}.ply", "--cameras", "orbit"]) == 2
    assert "expected a path without { } < >" in capsys.readouterr().err
    Path("my {model}.ply").rename("<model>.ply")
    assert main(["audit", "<model>.ply", "--cameras", "orbit"]) == 2
    assert "expected a path without { } < >" in capsys.readouterr().err
    Path("<model>.ply").rename("my model.ply")
    assert main(["audit", "my model.ply", "--cameras", "none.json"]) == 2
    assert "cameras: expected an existing file or folder" in capsys.readouterr().err
    assert not Path("results").exists()
    assert main(["audit", "my model.ply", "--cameras", "orbit"]) == 0


def test_a_dry_run_names_the_configuration_of_an_equal_audit(folder, words):
    audit = ["audit", "my model.ply", "--cameras", "orbit"]
    assert main(audit) == main([*audit, "--dry-run"]) == 0
    assert words.count("results/audit.yaml") == 2


def test_a_dry_run_of_which_only_the_beginning_is_read_ends_without_a_traceback(folder):
    dry_run = [sys.executable, "-m", "gspure", "audit", "my model.ply", "--cameras", "orbit", "--dry-run"]
    with subprocess.Popen(dry_run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        run.stdout.readline()
        run.stdout.close()
        assert "Traceback" not in run.stderr.read()
    assert run.returncode == 1


def test_a_folder_that_a_killed_run_locked_is_refused_with_the_command_that_unlocks_it(folder, words, capsys):
    lock = Path(".snakemake/locks/0.input.lock")
    lock.parent.mkdir(parents=True)
    lock.touch()
    audit = ["audit", "my model.ply", "--cameras", "orbit"]
    assert main([*audit, "--dry-run"]) == 0
    words.clear()
    assert main(audit) == 2
    (error,) = capsys.readouterr().err.splitlines()
    _, *unlock = shlex.split(error[error.index("gspure audit results/") : -1])
    assert not words
    assert main(unlock) == 0
    assert words[-1] == "--unlock"
    lock.unlink()
    assert main(audit) == 0


def test_of_two_runs_that_start_at_once_the_second_is_refused(folder, monkeypatch, capsys):
    audit, statuses = ["audit", "my model.ply", "--cameras", "orbit"], []

    def started(*_):
        monkeypatch.setattr(os, "execve", lambda *_: pytest.fail("a second run"))
        statuses.append(main(audit))
        return 0

    monkeypatch.setattr(os, "execve", started)
    assert main(audit) == 0
    assert statuses == [2]
    assert len(capsys.readouterr().err.splitlines()) == 1
    monkeypatch.setattr(os, "execve", lambda *_: 0)
    assert main(audit) == 0


def test_the_process_that_an_audit_becomes_holds_its_lock(folder, tmp_path):
    (tmp_path / "wait.py").write_text("import time; print(flush=True); time.sleep(60)")
    code = (
        "import os, sys; from gspure.cli import main; run = os.execve;"
        f"os.execve = lambda p, _, e: run(p, [p, {str(tmp_path / 'wait.py')!r}], e); main(sys.argv[1:])"
    )
    audit = ["audit", "my model.ply", "--cameras", "orbit"]
    with subprocess.Popen([sys.executable, "-c", code, *audit], stdout=subprocess.PIPE) as first:
        first.stdout.readline()
        assert main(audit) == 2
        first.kill()


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("audit no.ply --cameras orbit", "no.ply: no such file"),
        ("audit no.yaml", "no.yaml: no such file"),
        ("audit model.ply", "--cameras: expected"),
        ("audit mine.yaml --cameras orbit", "mine.yaml: --cameras: expected"),
        ("audit broken.yaml", "broken.yaml: file: expected a configuration"),
    ],
)
def test_bad_input_is_refused_in_one_line_before_snakemake_starts(folder, words, capsys, line, reason):
    Path("my model.ply").rename("model.ply")
    Path("mine.yaml").write_text("assets: {}")
    Path("broken.yaml").write_text("assets: [")
    assert main(line.split()) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert reason in error
    assert not words
    assert not Path("results").exists()
