import gzip
import json

import numpy as np
import pytest
from PIL import Image

from gspure.cameras import Camera, intrinsics, read_cameras, write_cameras
from gspure.cli import main
from gspure.errors import InputError

POSE = np.eye(4).tolist()


def view(name, image=None):
    return Camera(name, 8, 6, intrinsics(8, 8, 4, 3), np.eye(4), image)


def colmap(folder):
    folder.mkdir(parents=True)
    (folder / "cameras.txt").write_text("1 PINHOLE 8 6 8 8 4 3\n")
    (folder / "images.txt").write_text("1 1 0 0 0 0 0 0 1 from_colmap.jpg\n\n")


def test_camera_files_are_recognized_by_content(tmp_path):
    frame = {"file_path": "b.png", "transform_matrix": POSE}
    (tmp_path / "cameras.json").write_text(json.dumps({"w": 8, "h": 6, "fl_x": 8, "frames": [frame]}))
    assert [c.name for c in read_cameras(tmp_path / "cameras.json")] == ["b"]
    assert [c.name for c in read_cameras(str(tmp_path))] == ["b"]


def test_a_colmap_model_has_priority_over_cameras_json(tmp_path):
    write_cameras(tmp_path / "cameras.json", [view("a")])
    colmap(tmp_path / "sparse" / "0")
    assert [c.name for c in read_cameras(tmp_path)] == ["from_colmap"]
    assert [c.name for c in read_cameras(tmp_path / "cameras.json")] == ["a"]


@pytest.mark.parametrize("content", ["{}", "3", "null", '"text"', "{", "", "[" * 100_000, "9" * 5000, "\x00"])
def test_a_file_that_is_not_a_camera_file_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "cameras.json"
    path.write_text(content)
    with pytest.raises(InputError) as caught:
        read_cameras(path)
    assert str(caught.value).startswith(f"{path}: file: expected ")
    assert "\n" not in str(caught.value)


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


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (gzip.compress(b"[]", mtime=0), "found a gzip file .unpack it first"),
        (b"[\xff]", "found no UTF-8 text"),
        (b'{"img_name": "a"}', r"an object with img_name .a single camera\? Put \[ \] around it"),
        (b"7", "found something else"),
    ],
)
def test_a_file_that_is_no_list_of_cameras_is_named(tmp_path, content, message):
    (tmp_path / "cameras.json").write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_cameras(tmp_path / "cameras.json")
