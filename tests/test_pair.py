"""Pairs: a scene and a message from the same poses, ray-traced or of captures that have worlds of their own."""

from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gspure.cameras import read_cameras, write_cameras
from gspure.cli import main
from gspure.files import read_json
from gspure.images import read_image
from gspure.model import read_model, write_model
from gspure.model.ply import read_point_ply
from gspure.model.rotations import moved
from gspure.renderer import Renderer
from gspure.scenes.alignment import Similarity
from gspure.schemes.pair import read_pair
from tests.models import blobs
from tests.training_cases import colmap_project, ring


def test_a_traced_pair_has_views_points_and_both_scenes(pair_folder):
    pair = read_pair(pair_folder)
    assert pair.shares_poses
    for capture in (pair.scene, pair.message):
        assert len(capture.views) == len(capture.images) == 10
        assert capture.images[0].shape == (36, 48, 3)
        assert [camera.name for camera in capture.dataset.test] == ["view_000", "view_008"]
    assert len(pair.points[0]) == len(pair.points[1]) == len(pair.scene.dataset.xyz) + len(pair.message.dataset.xyz)
    assert np.abs(pair.scene.images[0] - pair.message.images[0]).mean() > 0.1
    assert {scene == message for scene, message in islice(pair.batches(np.random.default_rng(0)), 30)} == {True}


@pytest.fixture
def photographed(tmp_path):
    """A COLMAP project of one scene, and the model of another."""
    project = colmap_project(tmp_path / "photos", ring(), np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3)))
    write_model(tmp_path / "hidden.ply", blobs(200, 3, sh_degree=0))
    return project, tmp_path / "hidden.ply"


def test_photographs_and_a_model_become_a_pair(photographed, tmp_path):
    project, model = photographed
    out = tmp_path / "pair"
    words = ["pair", str(project), str(model), "--out", str(out), "--resolution", "native"]
    assert main(words) == 0
    assert main(words) == 2  # models may have been trained on it
    pair = read_pair(out)
    cameras = read_cameras(out / "cameras.json")
    for camera in cameras[:2]:
        shown = np.clip(Renderer(read_model(model)).image(camera), 0, 1)
        np.testing.assert_allclose(read_image(out / "message" / f"{camera.name}.png"), shown, atol=1 / 254)
    assert len(read_point_ply(out / "message" / "points3D.ply")[0]) > 0
    assert len(pair.scene.views) + len(pair.scene.dataset.test) == len(cameras)
    assert pair.shares_poses


@pytest.mark.parametrize("protocol", ["own", "shared"])
def test_embedding_two_captures_makes_their_pair_on_the_way(photographed, tmp_path, monkeypatch, protocol):
    monkeypatch.chdir(tmp_path)
    project, model = map(str, photographed)
    words = ["embed", "planted", "--scene", project, "--message", project if protocol == "own" else model]
    assert main([*words, "--out", "marked", "--resolution", "native", "--set", "gaussians=300"]) == 0
    assert read_json(Path("marked/pair/provenance.json"))["settings"]["protocol"] == protocol
    assert read_json(Path("marked/key/provenance.json"))["inputs"]["pair"]["path"] == "marked/pair"
    assert main(["extract", "marked/public", "--key", "marked/key", "--split", "test", "--out", "message"]) == 0
    assert main([*words, "marked/pair", "--out", "again"]) == 2


def test_a_model_with_cameras_is_aligned_with_the_photographs(photographed, tmp_path, capsys):
    project, model = photographed
    rng = np.random.default_rng(0)
    rotation = Rotation.random(random_state=rng)
    by = Similarity(2.5, rotation.as_matrix(), rng.normal(size=3))
    folder = tmp_path / "trained"
    write_model(folder / "point_cloud.ply", moved(read_model(model), rotation.as_rotvec(), by.translation, by.scale))
    write_cameras(folder / "cameras.json", [replace(by.camera(camera), image=None) for camera in read_cameras(project)])
    out = tmp_path / "pair"
    assert main(["pair", str(project), str(folder), "--out", str(out), "--resolution", "native"]) == 0
    assert "message aligned with the scene" in capsys.readouterr().err
    xyz = read_point_ply(out / "message" / "points3D.ply")[0]
    assert all(np.abs(read_model(model).means - point).max(axis=1).min() < 1e-4 for point in xyz)
