"""``gspure train`` from a folder of photographs to a folder that others open."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from gspure.cameras import read_cameras
from gspure.cli import main
from gspure.evaluation.comparison import read_metrics
from gspure.files import read_json
from gspure.images import read_image
from gspure.model import read_model
from gspure.model.inria import training_arguments
from gspure.renderer import Renderer
from gspure.training import checkpoints
from gspure.training.dataset import read_dataset
from tests.models import gaussians
from tests.training_cases import blender_scene, colmap_project, ring

ITERATIONS = 410
"""The shortest run that densifies."""

BLOBS = gaussians(
    means=[[-0.25, 0, 0], [0.2, 0.2, 0], [0.1, -0.2, 0.2]],
    scales=[0.1, 0.15, 0.08],
    opacities=0.95,
    colors=[[0.9, 0.2, 0.1], [0.1, 0.8, 0.3], [0.2, 0.3, 0.9]],
)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """Pictures of three blobs, and points near them."""
    views, renderer = ring(16), Renderer(BLOBS)
    points = np.random.default_rng(3).normal(scale=0.25, size=(60, 3))
    return colmap_project(
        tmp_path_factory.mktemp("data") / "blobs", views, points, [renderer.image(view) for view in views]
    )


@pytest.fixture(scope="module")
def cut_outs(tmp_path_factory):
    """A Blender scene of dark blobs, its photographs transparent beside them."""
    splits = {"train": ring(16), "test": ring(3)}
    return blender_scene(tmp_path_factory.mktemp("data") / "cut_outs", splits, BLOBS)


def train(project, out, *more, iterations=ITERATIONS):
    return main(["train", str(project), "--out", str(out), "--iterations", str(iterations), *more])


@pytest.fixture(scope="module")
def trained(project, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "trained"
    assert train(project, out) == 0
    return out


def ply(out):
    return (out / "point_cloud" / f"iteration_{ITERATIONS}" / "point_cloud.ply").read_bytes()


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_held_out_views_look_like_their_photographs(trained):
    rows = read_metrics(trained / "metrics.csv")
    assert [row.view for row in rows] == ["orbit_000", "orbit_008"]
    assert {row.reference for row in rows} == {"truth"}
    assert min(row.psnr for row in rows) > 25
    for row in rows:
        for folder in ("gt", "renders"):
            image = read_image(trained / "test" / f"ours_{ITERATIONS}" / folder / f"{row.view}.png")
            assert image.shape == (24, 32, 3)


def test_the_output_is_a_model_folder_to_other_commands(project, trained, tmp_path, capsys):
    names = {"cameras.json", "cfg_args", "input.ply", "metrics.csv", "point_cloud", "provenance.json", "test"}
    assert {path.name for path in trained.iterdir()} == names
    cameras = read_cameras(trained)
    assert len(cameras) == 16
    assert {camera.image.resolve().parent for camera in cameras} == {(project / "images").resolve()}
    assert main(["info", str(trained)]) == 0
    assert str(len(read_model(trained))) in capsys.readouterr().out
    assert main(["render", str(trained), "--cameras", str(trained), "--out", str(tmp_path), "--split", "test"]) == 0
    for file in (trained / "test" / f"ours_{ITERATIONS}" / "renders").glob("*.png"):
        assert (tmp_path / file.name).read_bytes() == file.read_bytes()


@pytest.mark.parametrize("threads", ["1", "2"])
def test_the_same_command_gives_the_same_file_on_any_number_of_threads(project, trained, tmp_path, threads):
    """On PoCL, whose threads an environment variable sets."""
    arguments = ["train", str(project), "--out", str(tmp_path), "--iterations", str(ITERATIONS)]
    environment = {**os.environ, "POCL_MAX_PTHREAD_COUNT": threads}
    subprocess.run([sys.executable, "-m", "gspure", *arguments], env=environment, check=True, capture_output=True)
    assert ply(tmp_path) == ply(trained)


def test_a_killed_run_resumed_gives_the_same_file(project, trained, tmp_path, monkeypatch, capsys):
    write = checkpoints.write_checkpoint

    def write_and_die(*args):
        write(*args)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("gspure.cli.train._SECONDS_BETWEEN_CHECKPOINTS", 0)
        patched.setattr(checkpoints, "write_checkpoint", write_and_die)
        assert train(project, tmp_path) == 130
    assert train(project, tmp_path, "--resume", "--seed", "1") == 2
    assert "seed: expected 1, found 0" in capsys.readouterr().err
    assert train(project, tmp_path, "--resume") == 0
    assert "continuing from iteration" in capsys.readouterr().err
    assert ply(tmp_path) == ply(trained)
    assert not (tmp_path / "checkpoint.npz").exists()


def test_growth_is_bounded_and_progress_is_printed_in_lines_without_a_terminal(project, trained, tmp_path, capsys):
    most = read_dataset(project, "320px").max_gaussians
    assert read_json(trained / "provenance.json")["settings"]["max_gaussians"] == most
    assert len(read_model(trained)) <= most
    assert train(project, tmp_path, "--max-gaussians", "50") == 0
    told = capsys.readouterr().err
    last = next(line for line in told.splitlines() if line.startswith(f"train: {ITERATIONS} of {ITERATIONS}"))
    for word in ("loss", "PSNR", "Gaussians", "it/s"):
        assert word in last
    assert len(read_model(tmp_path)) <= 50


def test_transparent_photographs_train_to_the_chosen_background(cut_outs, tmp_path):
    """Composited on black, as they once were whatever the background, they train to a flat grey of 10 dB or less."""
    assert train(cut_outs, tmp_path, "--background", "1", "1", "1") == 0
    rows = read_metrics(tmp_path / "metrics.csv")
    assert [row.view for row in rows] == ["test_r_0", "test_r_1", "test_r_2"]
    assert min(row.psnr for row in rows) > 25
    truth = read_image(tmp_path / "test" / f"ours_{ITERATIONS}" / "gt" / "test_r_0.png")
    assert truth[0, 0].tolist() == [1, 1, 1]


def test_the_white_background_of_cfg_args_is_kept(cut_outs, tmp_path):
    scene = tmp_path / "scene"
    shutil.copytree(cut_outs, scene)
    (scene / "cfg_args").write_text("Namespace(white_background=True)")
    for name, source, options in (
        ("asked", cut_outs, ["--background", "1", "1", "1"]),
        ("known", scene, []),
        ("black", scene, ["--background", "0", "0", "0"]),
    ):
        assert train(source, tmp_path / name, *options, iterations=60) == 0
    models = [read_model(tmp_path / name) for name in ("asked", "known", "black")]
    assert models[0].table.tobytes() == models[1].table.tobytes() != models[2].table.tobytes()
    assert [model.background for model in models] == [(1, 1, 1), (1, 1, 1), (0, 0, 0)]
    assert [training_arguments(tmp_path / name)["white_background"] for name in ("known", "black")] == [True, False]


def test_a_run_replaces_all_results_of_an_earlier_one(project, cut_outs, tmp_path):
    reused, fresh = tmp_path / "reused", tmp_path / "fresh"
    assert train(cut_outs, reused, iterations=3) == 0
    (reused / "notes.txt").write_text("of the user")
    for out in (reused, fresh):
        assert train(project, out, iterations=2) == 0
    (reused / "notes.txt").unlink()
    assert contents(reused).keys() == contents(fresh).keys()
    assert read_model(reused).table.tobytes() == read_model(fresh).table.tobytes()


def test_results_of_an_earlier_run_stay_until_the_new_ones_are_complete(project, trained, tmp_path, monkeypatch):
    out = tmp_path / "out"
    shutil.copytree(trained, out)
    before = contents(out)
    monkeypatch.setattr("gspure.evaluation.comparison.write_metrics", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        train(project, out, iterations=2)
    after = contents(out)
    assert {path for path in before if after[path] != before[path]} == {(out / "provenance.json").relative_to(out)}


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--out", "file"], "file"),
        (["--out", "out", "--model", "file/model.ply"], "file"),
        (["--out", "out", "--resolution=huge"], "resolution: value: expected native"),
        (["--out", "other"], "other: --out: expected an empty folder or results of `gspure train`"),
    ],
)
def test_a_bad_option_is_refused_before_training(project, tmp_path, monkeypatch, capsys, options, line):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gspure.cli.train._train", lambda *_: pytest.fail("trains first"))
    (tmp_path / "file").touch()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "model.ply").touch()
    assert main(["train", str(project), *options]) == 2
    assert line in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "out").exists()
