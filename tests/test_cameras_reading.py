import json

import numpy as np
import pytest
from PIL import Image

from gspure.cameras import Camera, intrinsics, read_cameras, require_images, write_cameras
from gspure.errors import InputError

POSE = np.eye(4).tolist()


def view(name, image=None):
    return Camera(name, 8, 6, intrinsics(8, 8, 4, 3), np.eye(4), image)


def colmap(folder):
    folder.mkdir(parents=True)
    (folder / "cameras.txt").write_text("1 PINHOLE 8 6 8 8 4 3\n")
    (folder / "images.txt").write_text("1 1 0 0 0 0 0 0 1 from_colmap.jpg\n\n")


def test_an_output_folder_is_read_by_its_cameras_json(tmp_path):
    write_cameras(tmp_path / "cameras.json", [view("a")])
    assert [c.name for c in read_cameras(tmp_path)] == ["a"]


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


def test_every_view_needs_its_photograph_where_photographs_are_required(tmp_path):
    photo = tmp_path / "a.png"
    Image.new("RGB", (8, 6)).save(photo)
    require_images([view("a", photo)], tmp_path)
    with pytest.raises(InputError, match=r"photographs: expected .* 3 views, found 2 missing: view b, .*c\.png$"):
        require_images([view("a", photo), view("b"), view("c", tmp_path / "c.png")], tmp_path)


def test_a_photograph_smaller_than_its_view_or_broken_is_refused(tmp_path):
    photo = tmp_path / "a.png"
    Image.new("RGB", (8, 5)).save(photo)
    with pytest.raises(InputError, match=r"a\.image: expected a photograph of at least 8x6, found 8x5"):
        require_images([view("a", photo)], tmp_path)
    photo.write_bytes(b"no image")
    with pytest.raises(InputError, match=r"a\.png: file: expected an image"):
        require_images([view("a", photo)], tmp_path)
