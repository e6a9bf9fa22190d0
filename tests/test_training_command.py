"""``gspure train`` from a folder of photographs to a folder that others open."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from gspure.cameras import read_cameras
from gspure.cli import main
from gspure.metrics.comparison import read_metrics
from gspure.model import read_model
from gspure.model.inria import training_arguments
from gspure.renderer import Renderer
from gspure.training import output
from tests.models import gaussians
from tests.training_cases import blender_scene, colmap_project, ring

ITERATIONS = 410
"""The shortest run that densifies."""

FAST = ("--schedule", "fast", "--max-gaussians", "80")

BLOBS = gaussians(
    means=[[-0.25, 0, 0], [0.2, 0.2, 0], [0.1, -0.2, 0.2]],
    scales=[0.1, 0.15, 0.08],
    opacities=0.95,
    colors=[[0.9, 0.2, 0.1], [0.1, 0.8, 0.3], [0.2, 0.3, 0.9]],
)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """Pictures of three blobs, and points near them."""
    views = ring(16)
    renderer = Renderer(BLOBS)
    points = np.random.default_rng(3).normal(scale=0.25, size=(60, 3))
    return colmap_project(tmp_path_factory.mktemp("data"), views, points, [renderer.image(view) for view in views])


def words(project, out, *more):
    return ["train", str(project), "--out", str(out), "--iterations", str(ITERATIONS), *more]


@pytest.fixture(scope="module")
def trained(project, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "trained"
    assert main(words(project, out)) == 0
    return out


def ply(out):
    return (out / "point_cloud" / f"iteration_{ITERATIONS}" / "point_cloud.ply").read_bytes()


def test_the_output_is_a_model_folder_to_other_commands(project, trained, tmp_path, capsys):
    names = {"cameras.json", "cfg_args", "input.ply", "metrics.csv", "point_cloud", "provenance.json", "test"}
    assert {path.name for path in trained.iterdir()} == names
    assert {camera.image.resolve().parent for camera in read_cameras(trained)} == {(project / "images").resolve()}
    assert main(["info", str(trained)]) == 0
    assert str(len(read_model(trained))) in capsys.readouterr().out
    assert main(["render", str(trained), "--cameras", str(trained), "--out", str(tmp_path), "--split", "test"]) == 0
    for file in (trained / "test" / f"ours_{ITERATIONS}" / "renders").glob("*.png"):
        assert (tmp_path / file.name).read_bytes() == file.read_bytes()


def test_one_thread_gives_the_same_file(project, trained, tmp_path):
    """On PoCL, whose threads an environment variable sets."""
    environment = {**os.environ, "POCL_MAX_PTHREAD_COUNT": "1"}
    command = [sys.executable, "-m", "gspure", *words(project, tmp_path)]
    subprocess.run(command, env=environment, check=True, capture_output=True)
    assert ply(tmp_path) == ply(trained)


@pytest.fixture(scope="module")
def fast(project, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "fast"
    assert main(words(project, out, *FAST)) == 0
    return out


def test_a_fast_run_keeps_its_budget_and_learns_the_views(fast):
    rows = read_metrics(fast / "metrics.csv")
    assert len(read_model(fast)) <= 80
    assert min(row.psnr for row in rows) > 25


@pytest.mark.parametrize(("whole", "schedule"), [("trained", ()), ("fast", FAST)])
def test_a_killed_run_resumed_gives_the_same_file(whole, schedule, project, request, tmp_path, monkeypatch, capsys):
    trained = request.getfixturevalue(whole)
    write = output.write_checkpoint

    def write_and_die(*args):
        write(*args)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("gspure.cli.train._SECONDS_BETWEEN_CHECKPOINTS", 0)
        patched.setattr(output, "write_checkpoint", write_and_die)
        assert main(words(project, tmp_path, *schedule)) == 130
    assert main(words(project, tmp_path, *schedule, "--resume", "--seed", "1")) == 2
    assert "seed: expected 1, found 0" in capsys.readouterr().err
    assert main(words(project, tmp_path, *schedule, "--resume")) == 0
    assert "continuing from iteration" in capsys.readouterr().err
    assert ply(tmp_path) == ply(trained)
    assert not (tmp_path / "checkpoint.npz").exists()


def test_transparent_photographs_train_to_the_background_of_option_or_cfg_args(tmp_path):
    scene = blender_scene(tmp_path / "scene", {"train": ring(16), "test": ring(3)}, BLOBS)
    shutil.copytree(scene, tmp_path / "white")
    (tmp_path / "white" / "cfg_args").write_text("Namespace(white_background=True)")
    assert main(words(scene, tmp_path / "asked", "--background", "1", "1", "1")) == 0
    assert main(words(tmp_path / "white", tmp_path / "known")) == 0
    assert ply(tmp_path / "asked") == ply(tmp_path / "known")
    assert read_model(tmp_path / "asked").background == (1, 1, 1)
    assert training_arguments(tmp_path / "known")["white_background"] is True
    rows = read_metrics(tmp_path / "asked" / "metrics.csv")
    assert [row.view for row in rows] == ["test_r_0", "test_r_1", "test_r_2"]
    assert min(row.psnr for row in rows) > 25
