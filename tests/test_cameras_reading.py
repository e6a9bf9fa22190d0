"""Camera files: recognized by content, scaled, and those of other programs named with a way to convert them."""

import gzip
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from gspure.cameras import Camera, intrinsics, read_cameras, scaled, write_cameras
from gspure.cli import main
from gspure.errors import InputError
from tests.camera_cases import assert_refused, cameras, project
from tests.models import camera


def test_camera_files_are_recognized_by_content_and_a_colmap_model_has_priority(tmp_path):
    frame = {"file_path": "b.png", "transform_matrix": np.eye(4).tolist()}
    (tmp_path / "cameras.json").write_text(json.dumps({"w": 8, "h": 6, "fl_x": 8, "frames": [frame]}))
    assert [c.name for c in read_cameras(str(tmp_path))] == ["b"]
    model = tmp_path / "sparse" / "0"
    model.mkdir(parents=True)
    (model / "cameras.txt").write_text("1 PINHOLE 8 6 8 8 4 3\n")
    (model / "images.txt").write_text("1 1 0 0 0 0 0 0 1 from_colmap.jpg\n\n")
    assert [c.name for c in read_cameras(tmp_path)] == ["from_colmap"]
    assert [c.name for c in read_cameras(tmp_path / "cameras.json")] == ["b"]


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
        *((content, "file: expected") for content in (b"{}", b"null", b'"text"', b"{", b"", b"[" * 100_000, b"\x00")),
        (b"9" * 5000, "file: expected JSON"),
        (gzip.compress(b"[]", mtime=0), "found a gzip file .unpack it first"),
        (b"[\xff]", "found no UTF-8 text"),
        (b'{"img_name": "a"}', r"an object with img_name .a single camera\? Put \[ \] around it"),
        (b"7", "found something else"),
    ],
)
def test_a_file_that_is_no_list_of_cameras_is_named_in_one_line(tmp_path, content, message):
    (tmp_path / "cameras.json").write_bytes(content)
    assert_refused(tmp_path / "cameras.json", "file")
    with pytest.raises(InputError, match=message):
        read_cameras(tmp_path / "cameras.json")


def view(width, height):
    return Camera("view", width, height, intrinsics(width, 1.01 * width, width / 2, height / 2), np.eye(4))


@pytest.mark.parametrize(
    ("rule", "stored", "expected"),
    [
        ("native", (5187, 3361), (5187, 3361)),
        ("1/4", (5187, 3361), (1297, 840)),  # a half is rounded to the even number
        ("1/8", (3, 2), (1, 1)),
        ("1600px", (989, 742), (989, 742)),
        ("1600px", (9000, 1), (1600, 1)),
    ],
)
def test_a_rule_gives_a_view_its_size(rule, stored, expected):
    (camera,) = scaled([view(*stored)], rule)
    assert (camera.width, camera.height) == expected


def test_a_photograph_that_is_a_reduced_copy_gives_the_view_its_size(tmp_path):
    Image.new("RGB", (1237, 822)).save(tmp_path / "reduced.png")
    large = replace(view(4946, 3286), image=tmp_path / "reduced.png")
    (small,) = scaled([large], "photographs")
    assert (small.width, small.height) == (1237, 822)
    assert small.K[0, 0] / small.width == pytest.approx(large.K[0, 0] / large.width)


@given(cameras(), st.sampled_from(["native", "1/2", "1/7", "100px", "1600px"]))
def test_every_point_keeps_its_place_in_the_picture(camera, rule):
    (small,) = scaled([camera], rule)
    point = camera.centre + camera.viewmat[:3, :3].T @ [0.3, -0.2, 1.0]
    before, after = (project(c, point[None])[0][0] for c in (camera, small))
    assert after / [small.width, small.height] == pytest.approx(before / [camera.width, camera.height], rel=1e-6)


KITTI = "1.0 0 0 0 0 1 0 0 0 0 1 -2.5e-01\n1 0 0 0 0 1 0 0 0 0 1 0\n"
POSE = "1 0 0 0\n0 1 0 0\n0 0 1 2.5\n0 0 0 1\n"
FILES = {
    "cameras.xml": ('<?xml version="1.0" encoding="UTF-8"?>\n<document version="2.0.0">\n  <chunk/>', "Metashape"),
    "blocks.xml": ("<?xml version='1.0'?>\n<BlocksExchange/>", "ContextCapture"),
    "export.csv": ("#name,x,y,alt,heading,pitch,roll,f,px,py,k1\nIMG_1.jpg,1,2,3,4,5,6,7,8,9,10\n", "RealityCapture"),
    "bundle.out": ("# Bundle file v0.3\n2 10\n", "Bundler"),
    "scene.nvm": ("NVM_V3\n\n2\n", "VisualSFM"),
    "reconstruction.json": ('[\n {\n  "cameras": {"v2": {}}, "shots": {}}]', "OpenSfM"),
    "sfm_data.json": ('{\n "sfm_data_version": "0.3", "views": []}', "OpenMVG"),
    "cameras.sfm": ('{"version": ["1"], "featuresFolders": []}', "Meshroom"),
    "0001.json": ('{"fx": 1.0, "t_00": 1.0}', "Polycam"),
    "camera_path.json": ('{"keyframes": [], "camera_path": []}', "nerfstudio's viewer"),
    "00.txt": ("# poses\n" + KITTI, "KITTI"),
    "trajectory.txt": ("# timestamp tx ty tz qx qy qz qw\n1305031102.17 1 2 3 0 0 0 1\n", "TUM"),
    "0_train_0001.txt": (POSE, "NSVF"),
    "traj.log": ("0 0 0\n" + POSE, "Tanks and Temples"),
    "database.db": ("SQLite format 3\0", "COLMAP's database"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_camera_file_of_another_program_is_named_with_a_way_to_convert_it(tmp_path, name):
    content, program = FILES[name]
    (tmp_path / name).write_text(content)
    for source in (tmp_path, tmp_path / name):
        with pytest.raises(InputError, match=rf"found those of {program}.*\(.*([Cc]olmap|COLMAP|ns-|transforms)"):
            read_cameras(source)


def test_numpy_files_are_named_and_any_other_is_refused_without_a_parsers_words(tmp_path):
    np.save(tmp_path / "poses_bounds.npy", np.zeros((3, 17)))
    with pytest.raises(InputError, match=r"those of LLFF in poses_bounds\.npy"):
        read_cameras(tmp_path)
    np.savez(tmp_path / "cameras_sphere.npz", world_mat_0=np.eye(4))
    with pytest.raises(InputError, match="those of NeuS or IDR"):
        read_cameras(tmp_path / "cameras_sphere.npz")
    (tmp_path / "poses.yaml").write_text("frames: 3")
    with pytest.raises(InputError, match=r"found a file of another kind \(export a COLMAP model"):
        read_cameras(tmp_path / "poses.yaml")


def test_own_files_beside_foreign_ones_are_read(tmp_path):
    write_cameras(tmp_path / "cameras.json", [camera()])
    (tmp_path / "cameras.xml").write_text(FILES["cameras.xml"][0])
    assert len(read_cameras(tmp_path)) == 1
