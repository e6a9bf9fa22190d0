import numpy as np
import pytest
from PIL import Image

from gspure.cameras import Camera, intrinsics, read_cameras, write_cameras
from gspure.cli import main
from gspure.model import write_model
from tests.models import blobs


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "source.json"
    views = [
        Camera(name, 3200, 1800, intrinsics(3000, 3000, 1600, 900), np.eye(4), tmp_path / f"{name}.png")
        for name in "cab"
    ]
    write_cameras(path, views)
    return path


def test_views_are_scaled_written_in_order_and_summarized(tmp_path, source, capsys):
    Image.new("RGB", (8, 8)).save(tmp_path / "a.png")
    assert main(["cameras", str(source), "--out", str(tmp_path / "out" / "cameras.json")]) == 0
    cameras = read_cameras(tmp_path / "out" / "cameras.json")
    assert [camera.name for camera in cameras] == ["c", "a", "b"]
    assert {(camera.width, camera.height, camera.K[0, 0]) for camera in cameras} == {(1600, 900, 1500.0)}
    assert capsys.readouterr().out.splitlines()[1].split() == ["3", "2", "1", "1600x900", "1500.0", "56.1°", "1"]


@pytest.mark.parametrize("kind", ["orbit", "shells"])
def test_views_are_generated_around_a_model(tmp_path, kind):
    model, out = tmp_path / "model.ply", tmp_path / "cameras.json"
    write_model(model, blobs(50))
    options = ["--count", "5", "--width", "2000", "--height", "90", "--fov", "60", "--up", "0", "0", "1"]
    assert main(["cameras", kind, "--model", str(model), "--out", str(out), *options]) == 0
    cameras = read_cameras(out)
    assert [(camera.width, camera.height) for camera in cameras] == [(2000, 90)] * 5
    assert cameras[0].viewmat[:3, :3] @ [0, 0, 1] == pytest.approx([0, *(cameras[0].viewmat[1:3, 2])], abs=1e-12)
