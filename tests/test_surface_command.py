"""``gspure surface``: distances for attack gof, and the mesh."""

import numpy as np
from plyfile import PlyData

from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.model import write_model
from tests.anchor_cases import random_public
from tests.models import camera, tilted_camera
from tests.surface_cases import around, ball, populated


def command(folder, model, *more, views=None):
    write_model(folder / "model.ply", model)
    write_cameras(folder / "cameras.json", views or around())
    where = ["--model", folder / "model.ply", "--cameras", folder / "cameras.json", "--split", "all"]
    return main(["surface", *map(str, [*where, "--out", folder / "surface.npy", *more])])


def test_the_command_measures_what_the_attack_takes(tmp_path, capsys):
    model, part = populated()
    assert command(tmp_path, model, "--mesh", tmp_path / "mesh.ply") == 0
    assert "method mesh: " in capsys.readouterr().out
    assert PlyData.read(tmp_path / "mesh.ply")["face"].count > 1000
    distances, out = tmp_path / "surface.npy", tmp_path / "attacked.ply"
    written = [
        "--model",
        tmp_path / "model.ply",
        "--surface",
        distances,
        "--out",
        out,
        "--removed",
        tmp_path / "mask.npy",
    ]
    assert main(["attack", "gof", *map(str, written)]) == 0
    kept = ~np.load(tmp_path / "mask.npy")
    np.testing.assert_array_equal(kept, np.load(distances) <= 3)
    assert kept[part == 0].mean() > 0.97


def test_the_command_takes_depths_on_demand_and_then_makes_no_mesh(tmp_path, capsys):
    model, _ = populated()
    assert command(tmp_path, model, "--method", "depth") == 0
    assert np.load(tmp_path / "surface.npy").dtype == np.float32
    assert command(tmp_path, model, "--method", "depth", "--mesh", tmp_path / "mesh.ply") == 2
    assert "--mesh: expected method mesh, found method depth" in capsys.readouterr().err


def test_anchors_get_depths_and_no_mesh(tmp_path, capsys):
    asset = random_public()
    asset.write(tmp_path / "model.ply")
    write_cameras(tmp_path / "cameras.json", [camera(name="a"), tilted_camera(name="b")])
    where = ["--model", tmp_path / "model.ply", "--cameras", tmp_path / "cameras.json", "--out", tmp_path / "out.npy"]
    assert main(["surface", *map(str, where)]) == 0
    assert "method depth: " in capsys.readouterr().out
    assert main(["surface", *map(str, where), "--method", "mesh"]) == 2
    assert "rows: expected Gaussians, for a mesh, found anchors" in capsys.readouterr().err


def test_a_model_too_large_for_a_mesh_gets_depths(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("gspure.cli.surface.MOST_OPAQUE", 10)
    assert command(tmp_path, ball(40)) == 0
    assert "method depth: " in capsys.readouterr().out
