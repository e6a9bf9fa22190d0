import numpy as np
from PIL import Image

from gspure.cameras import Camera, intrinsics, read_cameras, write_cameras
from gspure.cli import main


def test_views_are_scaled_written_in_order_and_summarized(tmp_path, capsys):
    K = intrinsics(3000, 3000, 1600, 900)
    views = [Camera(name, 3200, 1800, K, np.eye(4), tmp_path / f"{name}.png") for name in "cab"]
    write_cameras(tmp_path / "source.json", views)
    Image.new("RGB", (8, 8)).save(tmp_path / "a.png")
    out = tmp_path / "out" / "cameras.json"
    assert main(["cameras", str(tmp_path / "source.json"), "--out", str(out)]) == 0
    assert [camera.name for camera in read_cameras(out)] == ["c", "a", "b"]
    assert {(camera.width, camera.height, camera.K[0, 0]) for camera in read_cameras(out)} == {(1600, 900, 1500.0)}
    assert capsys.readouterr().out.splitlines()[1].split() == ["3", "2", "1", "1600x900", "1500.0", "56.1°", "1"]
