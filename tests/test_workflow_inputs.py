"""Files and options of jobs, from the resolved configuration."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from gspure.errors import InputError
from gspure.workflow.captures import camera_files, capture_files, model_files
from gspure.workflow.configuration import resolved
from gspure.workflow.options import options, repeated
from gspure.workflow.pairs import (
    message_model,
    other_pairs,
    pair_arguments,
    pair_files,
    pair_of,
    repetition_of,
    trained_message,
)
from tests.training_cases import colmap_project, ring

TRACED = {"scene": "room", "message": "vault", "protocol": "own", "placement": "raised", "seed": 1}
TRACED |= {"views": 9, "width": 32, "height": 24}
NOTHING_ELSE = {
    "method": {"views": None},
    "pairs": {},
    "schemes": {},
    "variants": {},
    "detectors": {},
    "decisions": {},
    "extractions": None,
}
PHOTOGRAPHED = {
    "scene": "garden",
    "message": "captures/playroom",
    "photographs": ["garden/images/a.png"],
    "message_photographs": ["captures/playroom/images/b.png"],
    "protocol": "shared",
    "resolution": "320px",
    "iterations": 20,
    "seed": 0,
}


@pytest.fixture
def garden(tmp_path, monkeypatch):
    """A COLMAP project."""
    monkeypatch.chdir(tmp_path)
    (model := tmp_path / "garden" / "sparse" / "0").mkdir(parents=True)
    for name in ("cameras.bin", "images.bin", "points3D.bin", "unrelated.bin"):
        (model / name).touch()
    return ["garden/sparse/0/cameras.bin", "garden/sparse/0/images.bin"]


def test_options_are_quoted_and_a_null_setting_has_none():
    settings = {"tau_c": 4.0, "cluster_on": ["position", "weight"], "tau_n": None, "model": "my model.ply"}
    assert options(settings, *settings) == "--tau-c 4.0 --cluster-on position weight --model 'my model.ply'"
    assert shlex.split(repeated("--set", {"codec": "a b", "n": 1})) == ["--set", "codec=a b", "--set", "n=1"]


def test_photographs_of_a_folder_in_the_project_are_relative(tmp_path, monkeypatch):
    """With absolute paths, a project that was moved would be trained again."""
    colmap_project(tmp_path / "photos", ring(), np.eye(3))
    monkeypatch.chdir(tmp_path)
    config = {**NOTHING_ELSE, "assets": {"desk": {"train": "photos", "clean": None}}}
    for photograph in resolved(config, "mine.yaml")["assets"]["desk"]["photographs"]:
        assert Path(photograph).parent == Path("photos/images")


def test_a_missing_photograph_is_named_before_any_job(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    colmap_project(tmp_path / "photos", ring(), np.eye(3))
    config = {**NOTHING_ELSE, "assets": {"desk": {"train": "photos", "clean": None}}}
    missing, *_ = map(Path, resolved(config, "mine.yaml")["assets"]["desk"]["photographs"])
    missing.unlink()
    with pytest.raises(InputError, match=rf"photos: photographs: expected one of each .* 1 missing: .*{missing.name}"):
        resolved(config, "mine.yaml")


def test_a_capture_is_its_cameras_points_and_photographs(garden):
    assert camera_files("garden") == garden
    assert capture_files("garden", ["a.png"]) == [*garden, "garden/sparse/0/points3D.bin", "a.png"]


def test_a_camera_file_is_tracked_with_the_points_beside_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "points3D.ply").touch()
    assert camera_files("transforms.json") == ["transforms.json"]
    assert capture_files("transforms.json", []) == ["transforms.json", "points3D.ply"]


def test_the_held_out_views_of_a_blender_scene_are_files_of_its_training(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    frame = {"transform_matrix": np.eye(4).tolist()}
    for split in ("train", "test"):
        content = {"w": 8, "h": 6, "fl_x": 8.0, "frames": [{**frame, "file_path": f"{split}/r_{split}"}]}
        (tmp_path / f"transforms_{split}.json").write_text(json.dumps(content))
        (tmp_path / split).mkdir()
        (tmp_path / split / f"r_{split}.png").touch()
    config = {**NOTHING_ELSE, "assets": {"lego": {"train": ".", "clean": None}}}
    photographs = resolved(config, "mine.yaml")["assets"]["lego"]["photographs"]
    assert photographs == ["train/r_train.png", "test/r_test.png"]
    assert capture_files(".", photographs) == ["transforms_train.json", "transforms_test.json", *photographs]


@pytest.mark.parametrize("ply", ["point_cloud.ply", "point_cloud/iteration_7/point_cloud.ply"])
@pytest.mark.parametrize("name", ["cfg_args", "chkpnt7_net.pth", "checkpoints.pth", "color_mlp.pt"])
def test_the_files_beside_a_model_are_part_of_it(tmp_path, monkeypatch, ply, name):
    monkeypatch.chdir(tmp_path)
    model = Path("run", ply)
    model.parent.mkdir(parents=True)
    for file in (model, Path("run", "chkpnt7_waternet.pth"), Path("run", "notes.txt")):
        file.write_text("")
    assert model_files("run") == model_files(str(model)) == [str(model)]
    Path("run", name).write_text("one")
    assert model_files("run") == [str(model), f"run/{name}"]
    pair = {name: value for name, value in PHOTOGRAPHED.items() if name != "message_photographs"}
    assert {str(model), f"run/{name}"} < {*pair_files({**pair, "message": "run"})}


def test_an_asset_is_a_pair_and_a_repetition():
    assert (pair_of("raised@2"), repetition_of("raised@2")) == ("raised", 2)
    assert (pair_of("raised"), repetition_of("raised")) == ("raised", 0)


def test_a_ray_traced_pair_is_made_from_no_files():
    assert pair_files(TRACED) == []
    expected = "room vault --protocol own --placement raised --views 9 --width 32 --height 24 --off-path 4 --seed 1"
    assert pair_arguments(TRACED, off_path=4) == expected


def test_a_photographed_pair_is_made_from_its_capture_and_the_model_of_its_message(garden):
    model = f"results/messages/{trained_message(PHOTOGRAPHED)}"
    assert model.startswith("results/messages/playroom-")
    files = pair_files(PHOTOGRAPHED)
    assert files[-1] == message_model(PHOTOGRAPHED) == model
    assert {*garden, *PHOTOGRAPHED["photographs"]} < {*files}
    assert pair_arguments(PHOTOGRAPHED, off_path=4) == f"garden {model} --protocol shared --resolution 320px --seed 0"


def test_a_message_is_trained_once_for_all_pairs_with_the_same_settings():
    assert trained_message({**PHOTOGRAPHED, "scene": "other"}) == trained_message(PHOTOGRAPHED)
    assert trained_message({**PHOTOGRAPHED, "seed": 1}) != trained_message(PHOTOGRAPHED)
    given = {name: value for name, value in PHOTOGRAPHED.items() if name != "message_photographs"}
    assert message_model({**given, "message": "hidden.ply"}) == "hidden.ply"


def test_another_scene_hides_another_message():
    pairs = {"a": TRACED, "b": TRACED, "c": PHOTOGRAPHED}
    assert other_pairs(pairs, "a") == ["c"]
    assert other_pairs({"a": TRACED, "b": TRACED}, "a") == []


def test_a_message_is_the_same_under_every_spelling_of_its_path(garden):
    Path("link").symlink_to("playroom")
    spelled = ("playroom", "playroom/", "garden/../playroom", "link")
    pairs = {message: {**PHOTOGRAPHED, "message": message} for message in (*spelled, "garden")}
    assert all(other_pairs(pairs, name) == ["garden"] for name in spelled)
