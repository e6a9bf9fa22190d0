"""Cameras of nerfstudio and Blender, and names of views: one visible file inside the output folder each."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from PIL import Image

from gspure.cameras import read_cameras
from gspure.cameras.nerfstudio import parse
from gspure.cameras.photographs import LONGEST_NAME, safe_name
from gspure.errors import InputError
from gspure.training.dataset import read_views
from tests.camera_cases import assert_refused, numbers, project, quats, rotation_from

POSE = [[1.0, 0, 0, 0.5], [0, 1.0, 0, -2.0], [0, 0, 1.0, 4.0], [0, 0, 0, 1]]
SHARED = {"camera_model": "OPENCV", "fl_x": 500.0, "fl_y": 510.0, "cx": 321.5, "cy": 239.0, "w": 640, "h": 480}
SHARED |= {"k1": 0.0, "k2": 0, "p1": 0.0, "p2": 0.0, "applied_transform": [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]]}
FRAME = {"file_path": "images/frame_00001.png", "transform_matrix": POSE}


def written(folder, content, name="transforms.json"):
    path = folder / name
    path.write_text(json.dumps(content))
    return path


def test_a_nerfstudio_file_is_read_with_photographs_and_intrinsics_of_all_or_of_each_frame(tmp_path):
    (camera,) = read_cameras(written(tmp_path, {**SHARED, "frames": [FRAME]}))
    assert camera.name == "frame_00001"
    assert (camera.width, camera.height) == (640, 480)
    assert camera.K.tolist() == [[500, 0, 321.5], [0, 510, 239], [0, 0, 1]]
    assert camera.image == tmp_path / "images" / "frame_00001.png"
    shared = {key: value for key, value in SHARED.items() if key not in {"fl_x", "w"}}
    frames = [FRAME | {"fl_x": 350, "w": 600.0, "h": 480.0}, FRAME | {"file_path": "b.png", "fl_x": 500, "w": 640}]
    first, second = read_cameras(written(tmp_path, {**shared, "frames": frames}))
    assert (first.K[0, 0], first.width) == (350, 600)
    assert (second.K[0, 0], second.width) == (500, 640)


@given(quats, numbers(-5, 5), numbers(-5, 5), numbers(0.1, 5))
def test_the_camera_looks_along_minus_z_with_y_up(tmp_path_factory, quat, x, y, depth):
    rotation = rotation_from(quat)
    position = np.array([3.0, -1.0, 2.0])
    matrix = np.column_stack([rotation, position]).tolist()
    (camera,) = parse(tmp_path_factory.getbasetemp(), {**SHARED, "frames": [FRAME | {"transform_matrix": matrix}]})
    point = rotation @ [x, y, -depth] + position
    pixel, z = project(camera, point[None])
    assert z[0] == pytest.approx(depth)
    assert pixel[0] == pytest.approx([321.5 + 500 * x / depth, 239 - 510 * y / depth], abs=1e-8)
    assert camera.centre == pytest.approx(position)


def test_a_blender_file_takes_its_size_from_the_image_and_its_focal_length_from_the_angle(tmp_path):
    (tmp_path / "train").mkdir()
    Image.new("RGBA", (80, 60)).save(tmp_path / "train" / "r_0.png")
    content = {"camera_angle_x": 0.7, "frames": [{"file_path": "./train/r_0", "transform_matrix": POSE}]}
    written(tmp_path, content, "transforms_train.json")
    (camera,) = read_cameras(tmp_path)
    assert camera.name == "train_r_0"
    assert (camera.width, camera.height) == (80, 60)
    assert camera.K[0, 0] == camera.K[1, 1] == pytest.approx(40 / math.tan(0.35))
    assert camera.K[:2, 2].tolist() == [40, 30]
    assert camera.image == tmp_path / "train" / "r_0.png"


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"k4": 0.01}, r"frames[0].k4"),
        ({"camera_model": "OPENCV_FISHEYE"}, "frames[0].camera_model"),
        ({"is_fisheye": True}, "frames[0].is_fisheye"),
        ({"ftheta_p0": 0, "ftheta_p1": 0.001}, "frames[0].ftheta_p1"),
    ],
)
def test_a_lens_other_than_a_pinhole_is_refused_with_a_remedy(tmp_path, change, field):
    for content in (SHARED | change | {"frames": [FRAME]}, SHARED | {"frames": [FRAME | change]}):
        with pytest.raises(InputError, match="colmap image_undistorter") as caught:
            read_cameras(written(tmp_path, content))
        assert caught.value.field == field


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"fl_x": 0}, "fl_x"),
        ({"fl_y": "wide"}, "fl_y"),
        ({"camera_model": ["OPENCV"]}, "camera_model"),
        ({"file_path": "images/.."}, "file_path"),
        ({"transform_matrix": (2 * np.eye(4)).tolist()}, "transform_matrix"),
        ({"transform_matrix": [*POSE[:3], [0, 0, 0, 2]]}, "transform_matrix"),
        ({"transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, math.nan]]}, "transform_matrix"),
    ],
)
def test_a_bad_value_is_refused_by_file_and_field(tmp_path, change, field):
    shared = {key: value for key, value in SHARED.items() if key not in change}
    assert_refused(written(tmp_path, {**shared, "frames": [FRAME | change]}), f"frames[0].{field}")


def test_a_pose_that_is_not_finite_is_left_out_of_splits_too(tmp_path, capsys):
    bad = np.full((4, 4), np.nan).tolist()
    frames = [FRAME | {"file_path": f"images/{i}.png", "transform_matrix": bad if i == 1 else POSE} for i in range(4)]
    lists = {"train_filenames": ["images/0.png", "images/2.png"], "test_filenames": ["images/3.png"]}
    views = read_views(written(tmp_path, {**SHARED, **lists, "frames": frames}))
    assert [camera.name for camera in views.cameras] == ["0", "2", "3"]
    assert "1 of 4 photographs left out, whose pose is not finite: images/1.png" in capsys.readouterr().err


OUT = Path("/out/folder").resolve()
PIECES = ("/", "\\", "..", ".", "~", " ", "\0", "\n", "\x1b[2J", "\ud800", "\u202e", "e\u0301", "images", ".JPG", "C:")
ANY_TEXT = st.text(st.characters(exclude_categories=()), max_size=400)
HOSTILE = st.lists(st.sampled_from(PIECES) | st.text("ab.", max_size=3), max_size=12).map("".join)


@given(ANY_TEXT | HOSTILE)
@example("//x/y")
@example("../../etc/passwd")
@example("a.jpg .png ")
@example("images/" + "é" * 300)
def test_a_name_is_one_visible_file_inside_the_output_folder(text):
    name = safe_name(text)
    if not name:  # refused by the readers
        assert not text.replace("\\", "/").strip("/. ")
        return
    for file in (f"{name}.png", name):
        path = (OUT / file).resolve()
        assert path.parent == OUT
        assert path.name == file
    assert not name.startswith(".")
    assert name.isprintable()
    assert len(name.encode()) <= LONGEST_NAME
    assert safe_name(name) == name, "written to cameras.json, the name must come back"


@pytest.mark.parametrize(
    ("files", "names"),
    [
        ("left/images/1.jpg right/images/1.jpg", "left_1 right_1"),
        ("a/left/images_2/1.jpg a/right/images_2/1.png a/images/2.jpg", "left_1 right_1 2"),
        ("images/1.jpg images/1.png images/2.jpg", "1_jpg 1_png 2"),
        ("r_0 r_0_1 r_0", "r_0_2 r_0_1 r_0_3"),
        ("left/images/1.jpg right/images/1.jpg images/left_1.jpg", "left_1_jpg right_1_jpg left_1"),
        ("C:\\l\\images\\1.JPG C:\\r\\images\\1.JPG", "l_1 r_1"),
        ("Images/1.jpg images/1.jpg", "Images_1 1"),
        (" ".join(["x" * 200] * 2), None),
    ],
)
def test_equal_names_are_kept_apart_by_what_distinguishes_their_files(tmp_path, capsys, files, names):
    frames = [FRAME | {"file_path": name} for name in files.split()]
    views = [camera.name for camera in read_cameras(written(tmp_path, {**SHARED, "frames": frames}))]
    assert len({*views}) == len(files.split())
    assert names is None or views == names.split()
    assert [safe_name(view) for view in views] == views, "written to cameras.json, the names must come back"
    assert capsys.readouterr().err.count("kept apart") == (names != "Images_1 1")
