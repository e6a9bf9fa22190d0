"""``gspure train`` from a folder of photographs to a folder that others open."""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from gspure.cameras import read_cameras
from gspure.cli import main
from gspure.evaluation.comparison import read_metrics
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

BLOBS = np.array([[-0.25, 0, 0], [0.2, 0.2, 0], [0.1, -0.2, 0.2]])
COLOURS = np.array([[0.9, 0.2, 0.1], [0.1, 0.8, 0.3], [0.2, 0.3, 0.9]])


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """Pictures of three blobs, and points near them."""
    model = gaussians(means=BLOBS, scales=[0.1, 0.15, 0.08], opacities=0.95, colors=COLOURS)
    views, renderer = ring(16), Renderer(model)
    points = np.random.default_rng(3).normal(scale=0.25, size=(60, 3))
    return colmap_project(
        tmp_path_factory.mktemp("data") / "blobs", views, points, [renderer.image(view) for view in views]
    )


def train(project, out, *more):
    return main(["train", str(project), "--out", str(out), "--iterations", str(ITERATIONS), *more])


@pytest.fixture(scope="module")
def trained(project, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "trained"
    assert train(project, out) == 0
    return out


def ply(out):
    return (out / "point_cloud" / f"iteration_{ITERATIONS}" / "point_cloud.ply").read_bytes()


def test_cameras_name_the_photographs(trained, project):
    cameras = read_cameras(trained)
    assert len(cameras) == 16
    assert {camera.image.resolve().parent for camera in cameras} == {(project / "images").resolve()}
    assert all(camera.image.is_file() for camera in cameras)


def test_held_out_views_look_like_their_photographs(trained):
    rows = read_metrics(trained / "metrics.csv")
    assert [row.view for row in rows] == ["orbit_000", "orbit_008"]
    assert {row.reference for row in rows} == {"truth"}
    assert min(row.psnr for row in rows) > 25
    for row in rows:
        for folder in ("gt", "renders"):
            image = read_image(trained / "test" / f"ours_{ITERATIONS}" / folder / f"{row.view}.png")
            assert image.shape == (24, 32, 3)


def test_the_output_is_a_model_folder_to_other_commands(trained, capsys):
    assert main(["info", str(trained)]) == 0
    assert str(len(read_model(trained))) in capsys.readouterr().out
    renders = trained / "again"
    assert main(["render", str(trained), "--cameras", str(trained), "--out", str(renders), "--split", "test"]) == 0
    held_out = trained / "test" / f"ours_{ITERATIONS}" / "renders"
    for file in held_out.glob("*.png"):
        assert (renders / file.name).read_bytes() == file.read_bytes()


def test_no_temporary_file_remains(trained):
    assert {path.name for path in trained.iterdir()} >= {"cameras.json", "cfg_args", "input.ply", "metrics.csv"}
    assert not (trained / "checkpoint.npz").exists()
    record = json.loads((trained / "point_cloud" / f"iteration_{ITERATIONS}" / "point_cloud.ply.json").read_text())
    assert record["settings"]["iterations"] == ITERATIONS


def test_the_same_command_gives_the_same_file(project, trained, tmp_path):
    assert train(project, tmp_path) == 0
    assert ply(tmp_path) == ply(trained)


@pytest.mark.parametrize("threads", ["1", "2"])
def test_the_number_of_threads_does_not_matter(project, trained, tmp_path, threads):
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


def test_resuming_without_a_checkpoint_starts_a_new_run(project, trained, tmp_path):
    assert train(project, tmp_path, "--resume") == 0
    assert ply(tmp_path) == ply(trained)


def test_progress_is_printed_in_lines_without_a_terminal(project, tmp_path, capsys):
    assert train(project, tmp_path, "--max-gaussians", "50") == 0
    told = capsys.readouterr().err
    last = next(line for line in told.splitlines() if line.startswith(f"train: {ITERATIONS} of {ITERATIONS}"))
    for word in ("loss", "PSNR", "Gaussians", "it/s"):
        assert word in last
    assert len(read_model(tmp_path)) <= 50


@pytest.fixture(scope="module")
def cut_outs(tmp_path_factory):
    """A Blender scene of dark blobs, its photographs transparent beside them."""
    model = gaussians(means=BLOBS, scales=[0.1, 0.15, 0.08], opacities=0.95, colors=COLOURS)
    splits = {"train": ring(16), "test": ring(3)}
    return blender_scene(tmp_path_factory.mktemp("data") / "cut_outs", splits, model)


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
        assert main(["train", str(source), "--out", str(tmp_path / name), "--iterations", "60", *options]) == 0
    models = [read_model(tmp_path / name) for name in ("asked", "known", "black")]
    assert models[0].table.tobytes() == models[1].table.tobytes() != models[2].table.tobytes()
    assert [model.background for model in models] == [(1, 1, 1), (1, 1, 1), (0, 0, 0)]
    assert [training_arguments(tmp_path / name)["white_background"] for name in ("known", "black")] == [True, False]


def test_the_photographs_bound_the_number_of_gaussians(project, trained):
    settings = json.loads((trained / "point_cloud" / f"iteration_{ITERATIONS}" / "point_cloud.ply.json").read_text())
    assert settings["settings"]["max_gaussians"] == read_dataset(project, "320px").max_gaussians
    assert len(read_model(trained)) <= read_dataset(project, "320px").max_gaussians


def test_an_unknown_resolution_is_refused_before_anything_is_written(project, tmp_path, capsys):
    assert main(["train", str(project), "--out", str(tmp_path / "out"), "--resolution=huge"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", [["--out", "file"], ["--out", "out", "--model", "file/model.ply"]])
def test_an_output_that_cannot_be_written_is_refused_before_training(project, tmp_path, monkeypatch, capsys, option):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gspure.cli.train._train", lambda *_: pytest.fail("trains first"))
    (tmp_path / "file").touch()
    assert main(["train", str(project), *option]) == 2
    assert "file" in capsys.readouterr().err.splitlines()[-1]


def test_a_corrupt_file_of_a_training_run_is_named(project, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["train", str(project), "--out", str(out), "--iterations", "2"]) == 0
    cameras = out / "cameras.json"
    cameras.write_bytes(cameras.read_bytes().replace(b",", b" ", 1))
    capsys.readouterr()
    assert main(["cameras", str(out), "--out", str(tmp_path / "cameras.json")]) == 2
    assert "corrupt" in capsys.readouterr().err


def test_a_run_replaces_all_results_of_an_earlier_one(project, cut_outs, tmp_path):
    reused, fresh = tmp_path / "reused", tmp_path / "fresh"
    assert main(["train", str(cut_outs), "--out", str(reused), "--iterations", "3"]) == 0
    (reused / "notes.txt").write_text("of the user")
    for out in (reused, fresh):
        assert main(["train", str(project), "--out", str(out), "--iterations", "2"]) == 0
    (reused / "notes.txt").unlink()
    assert _files(reused) == _files(fresh)
    assert read_model(reused).table.tobytes() == read_model(fresh).table.tobytes()


def test_results_of_an_earlier_run_stay_until_the_new_ones_are_complete(project, trained, tmp_path, monkeypatch):
    out = tmp_path / "out"
    shutil.copytree(trained, out)
    before = _contents(out)
    monkeypatch.setattr("gspure.evaluation.comparison.write_metrics", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        main(["train", str(project), "--out", str(out), "--iterations", "2"])
    assert _contents(out) == before


@pytest.mark.parametrize("name", ["point_cloud/*/point_cloud.ply", "cameras.json", "input.ply"])
def test_a_folder_with_a_file_of_another_trainer_is_refused_before_training(
    project, trained, tmp_path, monkeypatch, capsys, name
):
    monkeypatch.setattr("gspure.cli.train._train", None)
    shutil.copytree(trained, tmp_path / "out")
    (record,) = tmp_path.glob(f"out/{name}.json")
    record.unlink()
    assert main(["train", str(project), "--out", str(tmp_path / "out"), "--iterations", "2"]) == 2
    *_, line = capsys.readouterr().err.splitlines()
    assert "output: expected a result of an earlier run" in line
    assert ply(tmp_path / "out") == ply(trained)


def _files(folder):
    return sorted(path.relative_to(folder) for path in folder.rglob("*"))


def _contents(folder):
    return {path: (folder / path).read_bytes() for path in _files(folder) if (folder / path).is_file()}
