import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gspure.cameras import read_cameras, read_points
from gspure.cameras.reading import read_lenses
from gspure.errors import InputError
from tests.camera_cases import rotation_from

MODEL_IDS = {"SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4}
MODEL_IDS |= {"OPENCV_FISHEYE": 5, "FULL_OPENCV": 6}
LENSES = [
    (7, "PINHOLE", 640, 480, (500.0, 510.0, 321.5, 239.0)),
    (3, "SIMPLE_PINHOLE", 320, 240, (250.0, 160.0, 120.0)),
]
POSES = [
    (12, (0.9, -0.1, 0.3, 0.2), (0.5, -1.0, 4.0), 7, "left/0001.jpg", [(1.0, 2.0, 5), (3.0, 4.0, -1)]),
    (4, (-0.2, 0.7, 0.1, 0.6), (1.0, 2.0, 3.0), 3, "right/0001.jpg", []),
]
POINTS = [(5, (0.1, 0.2, 0.3), (255, 128, 0), 0.5, [(12, 0)]), (9, (-4.0, 5.0, 6.0), (1, 2, 3), 0.1, [(12, 1), (4, 0)])]


def binary(lenses=LENSES, poses=POSES, points=POINTS):
    """The three files' bytes, packed field by field as COLMAP documents them."""
    cameras = struct.pack("<Q", len(lenses))
    for camera_id, model, width, height, parameters in lenses:
        cameras += struct.pack("<iiQQ", camera_id, MODEL_IDS[model], width, height)
        cameras += struct.pack(f"<{len(parameters)}d", *parameters)
    images = struct.pack("<Q", len(poses))
    for image_id, quat, translation, camera_id, name, points_2d in poses:
        images += struct.pack("<i4d3di", image_id, *quat, *translation, camera_id) + name.encode() + b"\0"
        images += struct.pack("<Q", len(points_2d)) + b"".join(struct.pack("<ddq", *point) for point in points_2d)
    cloud = struct.pack("<Q", len(points))
    for point_id, xyz, rgb, error, track in points:
        cloud += struct.pack("<Q3d3Bd", point_id, *xyz, *rgb, error) + struct.pack("<Q", len(track))
        cloud += b"".join(struct.pack("<ii", *element) for element in track)
    return {"cameras.bin": cameras, "images.bin": images, "points3D.bin": cloud}


def text(lenses=LENSES, poses=POSES, points=POINTS):
    cameras = ["# Camera list", *(" ".join(map(str, [*lens[:4], *lens[4]])) for lens in lenses)]
    images = ["# Image list with two lines of data per image:"]
    for image_id, quat, translation, camera_id, name, points_2d in poses:
        images.append(" ".join(map(str, [image_id, *quat, *translation, camera_id, name])))
        images.append(" ".join(f"{x} {y} {i}" for x, y, i in points_2d))
    cloud = ["# 3D point list"]
    cloud += [" ".join(map(str, [i, *xyz, *rgb, error, *np.ravel(track)])) for i, xyz, rgb, error, track in points]
    files = {"cameras.txt": cameras, "images.txt": images, "points3D.txt": cloud}
    return {name: ("\n".join(lines) + "\n").encode() for name, lines in files.items()}


def written(folder, files):
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder


@pytest.mark.parametrize("files", [binary(), text()], ids=["binary", "text"])
def test_cameras_are_read_as_stored_in_the_images_order(tmp_path, files):
    cameras = read_cameras(written(tmp_path, files))
    assert [camera.name for camera in cameras] == ["left_0001", "right_0001"]
    assert [(camera.width, camera.height) for camera in cameras] == [(640, 480), (320, 240)]
    assert cameras[0].K.tolist() == [[500, 0, 321.5], [0, 510, 239], [0, 0, 1]]
    assert cameras[1].K.tolist() == [[250, 0, 160], [0, 250, 120], [0, 0, 1]]
    for camera, (_, quat, translation, *_rest) in zip(cameras, POSES, strict=True):
        assert camera.viewmat[:3, :3] == pytest.approx(rotation_from(quat), abs=1e-14)
        assert camera.viewmat[:3, 3].tolist() == list(translation)
        assert camera.image is None


@pytest.mark.parametrize("files", [binary(), text()], ids=["binary", "text"])
def test_points_are_read_with_their_colours(tmp_path, files):
    xyz, rgb = read_points(written(tmp_path, files))
    assert xyz.tolist() == [list(point[1]) for point in POINTS]
    assert rgb.tolist() == [list(point[2]) for point in POINTS]


@pytest.mark.parametrize("place", ["", "sparse", "sparse/0"])
def test_the_model_and_its_photographs_are_found_from_root_or_model_folder(tmp_path, place):
    model = written(tmp_path / "scene" / place, binary())
    (tmp_path / "scene" / "images").mkdir()
    for folder in (tmp_path / "scene", model):
        assert read_cameras(folder)[0].image == tmp_path / "scene" / "images" / "left" / "0001.jpg"


@pytest.mark.parametrize("write", [binary, text])
def test_a_fisheye_lens_is_refused_with_a_remedy(tmp_path, write):
    lenses = [(7, "OPENCV_FISHEYE", 640, 480, (500.0, 510.0, 320.0, 240.0, 0.1, 0.0, 0.0, 0.0)), LENSES[1]]
    with pytest.raises(InputError, match=r"camera 7\.model: .* found OPENCV_FISHEYE .*colmap image_undistorter"):
        read_cameras(written(tmp_path, write(lenses=lenses)))


@pytest.mark.parametrize("write", [binary, text])
@pytest.mark.parametrize(
    ("model", "parameters", "distortion"),
    [
        ("SIMPLE_RADIAL", (500.0, 320.0, 240.0, 0.1), (0.1, 0, 0, 0, 0, 0, 0, 0)),
        ("OPENCV", (500.0, 510.0, 320.0, 240.0, 0.1, 0.2, 0.3, 0.4), (0.1, 0.2, 0.3, 0.4, 0, 0, 0, 0)),
        ("FULL_OPENCV", (500.0, 510.0, 320.0, 240.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0), tuple(range(1, 9))),
    ],
)
def test_a_distorted_camera_is_read_only_to_undistort_it(tmp_path, write, model, parameters, distortion):
    folder = written(tmp_path, write(lenses=[(7, model, 640, 480, parameters), LENSES[1]]))
    assert read_lenses(folder)[0].distortion == distortion
    with pytest.raises(InputError, match=r"distortion: expected none, found .*--undistort"):
        read_cameras(folder)


@pytest.mark.parametrize("write", [binary, text])
@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"lenses": [(7, "PINHOLE", 640, 480, (0.0, 1.0, 1.0, 1.0)), LENSES[1]]}, r"cameras\.\w+: camera 7\.fx: "),
        ({"lenses": LENSES[:1]}, r"images\.\w+: image 4\.camera_id: expected a camera of .*, found 3"),
        ({"poses": [(1, (0, 0, 0, 0), (0, 0, 0), 7, "a.jpg", [])]}, r"images\.\w+: image 1\.quat: "),
        ({"poses": [(1, (1, 0, 0, 0), (0, np.inf, 0), 7, "a.jpg", [])]}, r"images\.\w+: image 1\.translation: "),
        ({"poses": []}, r"images\.\w+: views: expected at least one, found none"),
    ],
)
def test_a_bad_value_is_refused_by_file_and_field(tmp_path, write, parts, message):
    with pytest.raises(InputError, match=message):
        read_cameras(written(tmp_path, write(**parts)))


def read(folder, name):
    return read_points(folder) if name == "points3D.bin" else read_cameras(folder)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_truncated_or_longer_binary_file_is_refused(tmp_path, data):
    name = data.draw(st.sampled_from(["cameras.bin", "images.bin", "points3D.bin"]))
    files = binary()
    cut = files[name][: data.draw(st.integers(0, len(files[name]) - 1))]
    for content in (cut, files[name] + b"\0", struct.pack("<Q", 2**62) + files[name][8:]):
        with pytest.raises(InputError, match=f"{name}: file: "):
            read(written(tmp_path, files | {name: content}), name)


POINTS_2D = "1.5 2.5 7 nan 4 -1"


@pytest.mark.parametrize("below", ["", "\n", f"{POINTS_2D}\n"], ids=["no line", "empty line", "points"])
@pytest.mark.parametrize("name", ["a.jpg", "my photo 0.png", "1.jpg", "12 7 3.png"])
def test_every_image_is_read_with_and_without_a_line_of_points(tmp_path, capsys, below, name):
    poses = [f"{i} 1 0 0 0 0 {i} 4 7 {i}/{name}\n{below}" for i in range(5)]
    files = text() | {"images.txt": ("# Number of images: 5, mean observations: 2\n" + "".join(poses)).encode()}
    assert [camera.centre[1] for camera in read_cameras(written(tmp_path, files))] == [-0.0, -1, -2, -3, -4]
    assert "its header counts" not in capsys.readouterr().err
    files["images.txt"] = files["images.txt"].replace(b"images: 5", b"images: 6")
    read_cameras(written(tmp_path, files))
    assert "5 images, but its header counts 6" in capsys.readouterr().err


@pytest.mark.parametrize("write", [binary, text])
def test_a_pose_that_is_not_finite_is_left_out_by_name(tmp_path, capsys, write):
    bad = (5, (np.nan,) * 4, (0.0, 0.0, 0.0), 7, "left/0002.jpg", [])
    cameras = read_cameras(written(tmp_path, write(poses=[POSES[0], bad, POSES[1]])))
    assert [camera.name for camera in cameras] == ["left_0001", "right_0001"]
    assert "1 of 3 photographs left out, whose pose is not finite: left/0002.jpg" in capsys.readouterr().err


def test_masks_are_named(tmp_path, capsys):
    written(tmp_path / "sparse" / "0", binary())
    (tmp_path / "masks").mkdir()
    read_cameras(tmp_path)
    assert "masks are not used" in capsys.readouterr().err
