"""Camera files of other programs are named, with a way to convert them."""

import numpy as np
import pytest

from gspure.cameras import read_cameras, write_cameras
from gspure.errors import InputError
from tests.models import camera

KITTI = "1.0 0 0 0 0 1 0 0 0 0 1 -2.5e-01\n1 0 0 0 0 1 0 0 0 0 1 0\n"
POSE = "1 0 0 0\n0 1 0 0\n0 0 1 2.5\n0 0 0 1\n"
FILES = {
    "cameras.xml": ('<?xml version="1.0" encoding="UTF-8"?>\n<document version="2.0.0">\n  <chunk/>', "Metashape"),
    "Chunk 1.XML": ("<chunk label='1'>", "Metashape"),
    "blocks.xml": ("<?xml version='1.0'?>\n<BlocksExchange/>", "ContextCapture"),
    "export.csv": ("#name,x,y,alt,heading,pitch,roll,f,px,py,k1\nIMG_1.jpg,1,2,3,4,5,6,7,8,9,10\n", "RealityCapture"),
    "bundle.out": ("# Bundle file v0.3\n2 10\n", "Bundler"),
    "scene.nvm": ("NVM_V3\n\n2\n", "VisualSFM"),
    "reconstruction.json": ('[\n {\n  "cameras": {"v2": {}}, "shots": {}}]', "OpenSfM"),
    "sfm_data.json": ('{\n "sfm_data_version": "0.3", "views": []}', "OpenMVG"),
    "cameras.sfm": ('{"version": ["1"], "featuresFolders": []}', "Meshroom"),
    "0001.json": ('{"fx": 1.0, "t_00": 1.0}', "Polycam"),
    "camera_path.json": ('{"keyframes": [], "camera_path": []}', "nerfstudio's viewer"),
    "poses.txt": (KITTI, "KITTI"),
    "00.txt": ("# poses\n" + KITTI, "KITTI"),
    "trajectory.txt": ("# timestamp tx ty tz qx qy qz qw\n1305031102.17 1 2 3 0 0 0 1\n", "TUM"),
    "0_train_0001.txt": (POSE, "NSVF"),
    "intrinsics.txt": ("1111.1 400 400 0\n0 0 0\n1\n800 800\n", "NSVF"),
    "traj.log": ("0 0 0\n" + POSE, "Tanks and Temples"),
    "database.db": ("SQLite format 3\0", "COLMAP's database"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_camera_file_of_another_program_is_named_with_a_way_to_convert_it(tmp_path, name):
    content, program = FILES[name]
    (tmp_path / name).write_text(content)
    for source in (tmp_path, tmp_path / name):
        with pytest.raises(
            InputError, match=rf"nerfstudio, found those of {program}.*\(.*(COLMAP|ns-|[Cc]olmap|transforms)"
        ):
            read_cameras(source)


def test_numpy_files_are_named(tmp_path):
    np.save(tmp_path / "poses_bounds.npy", np.zeros((3, 17)))
    with pytest.raises(InputError, match=r"those of LLFF in poses_bounds\.npy"):
        read_cameras(tmp_path)
    np.savez(tmp_path / "cameras_sphere.npz", world_mat_0=np.eye(4))
    with pytest.raises(InputError, match="those of NeuS or IDR"):
        read_cameras(tmp_path / "cameras_sphere.npz")


def test_any_other_file_is_refused_without_a_parsers_words(tmp_path):
    (tmp_path / "poses.yaml").write_text("frames: 3")
    with pytest.raises(InputError, match=r"found a file of another kind \(export a COLMAP model"):
        read_cameras(tmp_path / "poses.yaml")


def test_own_files_beside_foreign_ones_are_read(tmp_path):
    write_cameras(tmp_path / "cameras.json", [camera()])
    (tmp_path / "cameras.xml").write_text(FILES["cameras.xml"][0])
    assert len(read_cameras(tmp_path)) == 1


def test_results_of_our_own_are_not_taken_for_cameras(tmp_path):
    for name, content in {"metrics.csv": "target,view\n", "weights.npy": "", "run.log": "device 0\n"}.items():
        (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match="found none of them"):
        read_cameras(tmp_path)
