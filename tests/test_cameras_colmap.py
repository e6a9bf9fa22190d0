"""COLMAP models, and photographs without lens distortion."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from gspure.cameras import Camera, read_cameras, read_points
from gspure.cameras.reading import read_lenses
from gspure.cameras.undistortion import undistort
from gspure.cli import main
from gspure.errors import InputError
from gspure.images import read_image, write_image
from gspure.model.ply import read_point_ply
from tests.camera_cases import rotation_from
from tests.models import camera

MODEL_IDS = {"SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4}
MODEL_IDS |= {"OPENCV_FISHEYE": 5, "FULL_OPENCV": 6}
LENSES = [
    (7, "PINHOLE", 640, 480, (500.0, 510.0, 321.5, 239.0)),
    (3, "SIMPLE_PINHOLE", 320, 240, (250.0, 160.0, 120.0)),
]
FISHEYE = (7, "OPENCV_FISHEYE", 640, 480, (500.0, 510.0, 320.0, 240.0, 0.1, 0.0, 0.0, 0.0))
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
def test_cameras_in_the_images_order_and_points_are_read_as_stored(tmp_path, files):
    cameras = read_cameras(written(tmp_path, files))
    assert [camera.name for camera in cameras] == ["left_0001", "right_0001"]
    assert [(camera.width, camera.height) for camera in cameras] == [(640, 480), (320, 240)]
    assert cameras[0].K.tolist() == [[500, 0, 321.5], [0, 510, 239], [0, 0, 1]]
    assert cameras[1].K.tolist() == [[250, 0, 160], [0, 250, 120], [0, 0, 1]]
    for view, (_, quat, translation, *_rest) in zip(cameras, POSES, strict=True):
        assert view.viewmat[:3, :3] == pytest.approx(rotation_from(quat), abs=1e-14)
        assert view.viewmat[:3, 3].tolist() == list(translation)
        assert view.image is None
    xyz, rgb = read_points(tmp_path)
    assert xyz.tolist() == [list(point[1]) for point in POINTS]
    assert rgb.tolist() == [list(point[2]) for point in POINTS]


@pytest.mark.parametrize("place", ["", "sparse", "sparse/0"])
def test_the_model_and_its_photographs_are_found_from_root_or_model_folder(tmp_path, place):
    model = written(tmp_path / "scene" / place, binary())
    (tmp_path / "scene" / "images").mkdir()
    for folder in (tmp_path / "scene", model):
        assert read_cameras(folder)[0].image == tmp_path / "scene" / "images" / "left" / "0001.jpg"


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
        ({"lenses": [FISHEYE, LENSES[1]]}, r"camera 7\.model: .* found OPENCV_FISHEYE .*colmap image_undistorter"),
        ({"lenses": LENSES[:1]}, r"images\.\w+: image 4\.camera_id: expected a camera of .*, found 3"),
        ({"poses": [(1, (0, 0, 0, 0), (0, 0, 0), 7, "a.jpg", [])]}, r"images\.\w+: image 1\.quat: "),
        ({"poses": [(1, (1, 0, 0, 0), (0, np.inf, 0), 7, "a.jpg", [])]}, r"images\.\w+: image 1\.translation: "),
        ({"poses": []}, r"images\.\w+: views: expected at least one, found none"),
    ],
)
def test_a_bad_value_is_refused_by_file_and_field(tmp_path, write, parts, message):
    with pytest.raises(InputError, match=message):
        read_cameras(written(tmp_path, write(**parts)))


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_truncated_or_longer_binary_file_is_refused(tmp_path, data):
    name = data.draw(st.sampled_from(["cameras.bin", "images.bin", "points3D.bin"]))
    read = read_points if name == "points3D.bin" else read_cameras
    files = binary()
    cut = files[name][: data.draw(st.integers(0, len(files[name]) - 1))]
    for content in (cut, files[name] + b"\0", struct.pack("<Q", 2**62) + files[name][8:]):
        with pytest.raises(InputError, match=f"{name}: file: "):
            read(written(tmp_path, files | {name: content}))


@pytest.mark.parametrize("below", ["", "\n", "1.5 2.5 7 nan 4 -1\n"], ids=["no line", "empty line", "points"])
@pytest.mark.parametrize("name", ["a.jpg", "my photo 0.png", "1.jpg", "12 7 3.png"])
def test_every_image_is_read_with_and_without_a_line_of_points(tmp_path, capsys, below, name):
    poses = [f"{i} 1 0 0 0 0 {i} 4 7 {i}/{name}\n{below}" for i in range(5)]
    files = text() | {"images.txt": ("# Number of images: 6, mean observations: 2\n" + "".join(poses)).encode()}
    assert [camera.centre[1] for camera in read_cameras(written(tmp_path, files))] == [-0.0, -1, -2, -3, -4]
    assert "5 images, but its header counts 6" in capsys.readouterr().err


@pytest.mark.parametrize("write", [binary, text])
def test_a_pose_that_is_not_finite_is_left_out_by_name(tmp_path, capsys, write):
    bad = (5, (np.nan,) * 4, (0.0, 0.0, 0.0), 7, "left/0002.jpg", [])
    cameras = read_cameras(written(tmp_path, write(poses=[POSES[0], bad, POSES[1]])))
    assert [camera.name for camera in cameras] == ["left_0001", "right_0001"]
    assert "1 of 3 photographs left out, whose pose is not finite: left/0002.jpg" in capsys.readouterr().err


LENSES_OF_ALL_KINDS = {
    "barrel": (-0.2, 0.05),
    "pincushion": (0.15,),
    "tangential": (0.02, -0.01, 0.004, -0.006),
    "all": (-0.1, 0.03, 0.002, -0.003, 0.01, 0.05, 0.01, 0.002),
}


def pattern(x, y):
    """A smooth picture of a plane at distance 1, three channels [N,3]."""
    return 0.5 + 0.4 * np.stack([np.sin(9 * x) * np.cos(8 * y), np.cos(11 * x + 3 * y), np.sin(7 * y - 5 * x)], -1)


def seen_through(lens: Camera) -> np.ndarray:
    """What a lens shows of the plane: the inverse of its distortion by fixed-point iteration."""
    rows, columns = np.indices((lens.height, lens.width)) + 0.5
    target = (np.stack([columns, rows], -1) - lens.K[:2, 2]) / lens.K[[0, 1], [0, 1]]
    k1, k2, p1, p2, k3, k4, k5, k6 = np.pad(lens.distortion, (0, 8 - len(lens.distortion)))
    undistorted = target.copy()
    for _ in range(60):
        x, y = np.moveaxis(undistorted, -1, 0)
        r2 = x**2 + y**2
        radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        shift = np.stack([2 * p1 * x * y + p2 * (r2 + 2 * x**2), p1 * (r2 + 2 * y**2) + 2 * p2 * x * y], -1)
        undistorted = (target - shift) / radial[..., None]
    return pattern(*np.moveaxis(undistorted, -1, 0))


def taken(folder: Path, distortion, **settings) -> Camera:
    view = camera(96, 72, focal=80.0, principal=(50.0, 33.0), **settings)
    lens = Camera(view.name, view.width, view.height, view.K, view.viewmat, folder / "photo.png", distortion)
    write_image(folder / "photo.png", seen_through(lens))
    return lens


@pytest.mark.parametrize("kind", LENSES_OF_ALL_KINDS)
def test_a_photograph_becomes_that_of_a_pinhole(tmp_path, kind):
    lens = taken(tmp_path, LENSES_OF_ALL_KINDS[kind])
    (pinhole,) = undistort([lens], tmp_path / "flat", tmp_path)
    assert (pinhole.distortion, pinhole.width, pinhole.height) == ((), lens.width, lens.height)
    rows, columns = np.indices((72, 96)) + 0.5
    x = (columns - pinhole.K[0, 2]) / pinhole.K[0, 0]
    y = (rows - pinhole.K[1, 2]) / pinhole.K[1, 1]
    assert np.abs(read_image(pinhole.image) - pattern(x, y)).max() < 0.01
    assert np.abs(seen_through(lens) - pattern(x, y)).max() > 0.05


def test_the_photograph_just_fills_the_image(tmp_path):
    for k1, least, largest in ((-0.2, 0.9, 0.99), (0.15, 1.01, 1.1)):
        (pinhole,) = undistort([taken(tmp_path, (k1,))], tmp_path / "flat", tmp_path)
        assert least < pinhole.K[0, 0] / 80 < largest
    (identical,) = undistort([taken(tmp_path, ())], tmp_path / "flat", tmp_path)
    np.testing.assert_allclose(identical.K[0], [80, 0, 50], atol=1e-6)


def test_a_distortion_too_strong_for_a_pinhole_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"view\.distortion"):
        undistort([Camera(**vars(taken(tmp_path, ())) | {"distortion": (-1e9,)})], tmp_path / "flat", tmp_path)


def test_the_command_writes_a_capture_without_distortion(tmp_path):
    source = tmp_path / "capture"
    lenses = [(7, "OPENCV", 96, 72, (80.0, 80.0, 50.0, 33.0, -0.2, 0.05, 0.0, 0.0)), LENSES[1]]
    written(source / "sparse" / "0", text(lenses=lenses))
    for name, (_, _, width, height, _) in {"left": lenses[0], "right": lenses[1]}.items():
        (source / "images" / name).mkdir(parents=True)
        Image.new("RGB", (width, height)).save(source / "images" / name / "0001.jpg")
    assert main(["cameras", str(source), "--undistort", "--out", str(tmp_path / "flat" / "cameras.json")]) == 0
    views = read_cameras(tmp_path / "flat")
    assert [view.name for view in views] == [view.name for view in read_lenses(source)]
    assert all(view.image.parent == tmp_path / "flat" / "images" and view.image.is_file() for view in views)
    assert len(read_point_ply(tmp_path / "flat" / "points3D.ply")[0]) > 0
