"""``gspure audit``: the workflow on a model or a configuration, in the current folder."""

import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from gspure.cli import audit, main
from gspure.model import write_model
from tests.models import blobs
from tests.workflow_cases import ROOT, settled


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_model(tmp_path / "my model.ply", blobs(30))
    return tmp_path


@pytest.fixture
def words(monkeypatch):
    """The command line of Snakemake, which is not started."""
    started = []
    monkeypatch.setattr(os, "execv", lambda program, command: started.extend(command) or 0)
    monkeypatch.setattr(audit, "_shown", lambda command: started.extend(command) or 0)
    return started


def test_a_model_becomes_a_configuration_that_another_model_does_not_replace(folder, words, capsys):
    assert main(["audit", "my model.ply", "--cameras", "orbit", "--up", "0", "0", "1", "--cores", "1"]) == 0
    file = Path(words[words.index("--configfile") + 1])
    (asset,) = settled(yaml.safe_load(file.read_text()))["assets"].values()
    assert (asset["model"], asset["cameras"], asset["generated"]["up"]) == ("my model.ply", "orbit", [0, 0, 1])
    assert Path(words[words.index("--snakefile") + 1]) == ROOT / "Snakefile"
    assert words[words.index("--cores") + 1] == "1"
    write_model(folder / "other.ply", blobs(30))
    assert main(["audit", "other.ply", "--cameras", "orbit"]) == 2
    assert "results/audit.yaml: assets: expected other, found my_model" in capsys.readouterr().err


def test_a_configuration_is_used_as_it_is_and_further_options_reach_snakemake(folder, words, capsys):
    Path("mine.yaml").write_text("{}")
    assert main(["audit", "mine.yaml", "--cameras", "orbit"]) == 2
    assert "mine.yaml: --cameras: expected nothing beside a configuration" in capsys.readouterr().err
    assert main(["audit", "mine.yaml", "--", "--forcerun", "all"]) == 0
    assert words[words.index("--configfile") + 1 :] == ["mine.yaml", "--forcerun", "all"]


def test_a_lock_is_removed_unless_a_run_holds_it(folder, words, monkeypatch, capsys):
    Path(".snakemake/locks").mkdir(parents=True)
    Path(".snakemake/locks/0.input.lock").touch()
    unlocked = []
    monkeypatch.setattr(subprocess, "run", lambda command, **_: unlocked.append("--unlock" in command))
    with Path(".snakemake/gspure.lock").open("w") as alive:
        fcntl.flock(alive, fcntl.LOCK_SH)
        assert main(["audit", "my model.ply", "--cameras", "orbit"]) == 2
    assert "expected no other run here" in capsys.readouterr().err
    assert main(["audit", "my model.ply", "--cameras", "orbit"]) == 0
    assert unlocked == [True]


def test_jobs_and_reasons_take_the_place_of_snakemake_s_lines(capfd):
    lines = ["Building DAG", "Job 3: Attacking", "1 of 4 steps (25%) done", "Job 2: Evaluating", "gspure: broken"]
    program = f"import sys; print(*{lines}, sep='\\n', file=sys.stderr); sys.exit(3)"
    assert audit._shown([sys.executable, "-c", program]) == 3
    shown = capfd.readouterr().err.splitlines()
    assert shown == ["0:00:00: Attacking", "1 of 4 jobs done, 0:00:00: Evaluating", "gspure: broken", ""]
