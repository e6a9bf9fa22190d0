"""The README does what it says: its commands, its configuration and its program run, its diagram is the workflow's."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.model import read_model, write_model
from gspure.scenes.photography import path_cameras
from tests.documentation import ROOT, blocks, edges, workflow_edges
from tests.planted_cases import planted_model
from tests.training_cases import colmap_project, ring

README = ROOT / "README.md"


@pytest.fixture(scope="module")
def planted():
    return planted_model(gaussians=600)[0].model


@pytest.fixture
def folder(tmp_path, monkeypatch, planted):
    """A user's folder with a model and its cameras, which is the current one."""
    write_model(tmp_path / "point_cloud.ply", planted)
    write_cameras(tmp_path / "cameras.json", path_cameras(9, 48, 36))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def commands(program):
    lines = (line.partition("#")[0].strip() for block in blocks(README, "sh") for line in block.splitlines())
    return [shlex.split(line)[1:] for line in lines if line.startswith(f"{program} ")]


def test_the_program_runs(folder, planted):
    (program,) = blocks(README, "python")
    names = {}
    exec(program, names)  # noqa: S102
    assert names["image"].shape == (36, 48, 3)
    assert names["gradients"].means.shape == names["purified"].model.means.shape
    kept = ~names["purified"].prune_mask
    assert read_model(Path("purified.ply")).table.tobytes() == planted.table[kept].tobytes()
    assert main(["purify", "point_cloud.ply", "--cameras", "cameras.json", "--out", "purified"]) == 0
    np.testing.assert_array_equal(np.load("purified/weights.npy"), names["purified"].weights)


QUICK = {
    "pair": ["--views", "8", "--width", "48", "--height", "36"],
    "embed": ["--set", "iterations=20"],
}
"""Options of the commands in tests."""


def test_the_commands_on_a_model_run_one_after_the_other(folder, capsys, monkeypatch):
    monkeypatch.setattr("gspure.cli.purify._draw", lambda *_: [])
    for arguments in commands("gspure"):
        if arguments[0] not in {"train", "audit"}:
            assert main([*arguments, *QUICK.get(arguments[0], [])]) == 0
    assert re.search(r"^mean +\d+\.\d+( +\d+\.\d+)+$", capsys.readouterr().out, re.MULTILINE)
    assert {path.name for path in folder.iterdir()} >= {"purified", "before", "after"}
    assert np.load("purified/prune_mask.npy").any()


def test_the_training_command_leaves_a_model(tmp_path, monkeypatch):
    colmap_project(tmp_path / "garden", ring(), np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3)))
    monkeypatch.chdir(tmp_path)
    (arguments,) = (arguments for arguments in commands("gspure") if arguments[0] == "train")
    assert main([*arguments, "--iterations", "3"]) == 0
    assert len(read_model(Path("trained"))) == 20


@pytest.mark.workflow
@pytest.mark.parametrize("source", ["model", "configuration"])
def test_a_model_or_its_configuration_is_all_that_the_workflow_needs(folder, source):
    (arguments,) = (arguments for arguments in commands("gspure") if arguments[0] == "audit")
    if source == "configuration":
        (config,) = blocks(README, "yaml")
        Path("mine.yaml").write_text(config)
        arguments = ["audit", "mine.yaml"]
    done = subprocess.run(
        [sys.executable, "-m", "gspure", *arguments, "--dry-run", "--cores", "1"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert re.search(r"^attack_model +8$", done.stdout, re.MULTILINE)
    assert re.search(r"^write_report +1$", done.stdout, re.MULTILINE)


@pytest.mark.workflow
def test_arrows_of_the_diagram_are_arrows_of_the_workflow(tmp_path):
    (diagram,) = blocks(README, "mermaid")
    assert edges(diagram) <= workflow_edges(tmp_path)
