import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from gspure.cameras import Camera, intrinsics, read_cameras, write_cameras
from gspure.errors import InputError
from tests.camera_cases import assert_refused, cameras

VIEW = {"id": 0, "img_name": "a", "width": 64, "height": 48, "fy": 41.0, "fx": 40.0, "position": [1.0, 2.0, 3.0]}
VIEW |= {"rotation": [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]}


def written(folder, *views):
    path = folder / "cameras.json"
    path.write_text(json.dumps(views))
    return path


def test_position_is_the_centre_and_rotation_maps_camera_to_world(tmp_path):
    (camera,) = read_cameras(written(tmp_path, VIEW))
    assert camera.centre == pytest.approx([1, 2, 3])
    forward_in_world = np.array(VIEW["rotation"]) @ [0, 0, 1]
    assert camera.viewmat[:3, :3] @ forward_in_world == pytest.approx([0, 0, 1])
    assert camera.K.tolist() == intrinsics(40, 41, 32, 24).tolist()


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cameras())
def test_a_written_camera_is_read_back_to_the_last_digit(tmp_path, camera):
    write_cameras(tmp_path / "cameras.json", [camera])
    (back,) = read_cameras(tmp_path / "cameras.json")
    assert (back.name, back.width, back.height) == (camera.name, camera.width, camera.height)
    assert back.K.tolist() == camera.K.tolist()
    assert back.viewmat[:3, :3].tolist() == camera.viewmat[:3, :3].tolist()
    length = math.hypot(*camera.viewmat[:3, 3])  # does not underflow
    tolerance = 8 * np.finfo(float).eps * length + np.finfo(float).tiny
    assert np.abs(back.viewmat[:3, 3] - camera.viewmat[:3, 3]).max() <= tolerance


def test_photographs_are_found_from_wherever_the_file_is_written(tmp_path, monkeypatch):
    photo = tmp_path / "photos" / "a.jpg"
    camera = Camera("a", 4, 3, intrinsics(4, 4, 2, 1.5), np.eye(4), photo)
    write_cameras(tmp_path / "results" / "scene" / "cameras.json", [camera])
    assert str(tmp_path) not in (tmp_path / "results" / "scene" / "cameras.json").read_text()
    monkeypatch.chdir(tmp_path / "results")
    (back,) = read_cameras(Path("scene/cameras.json"))
    assert back.image is not None
    assert back.image.resolve() == photo.resolve()


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"fx": 0}, "[1].fx"),
        ({"fy": float("nan")}, "[1].fy"),
        ({"width": 0}, "[1].width"),
        ({"position": [1, 2]}, "[1].position"),
        ({"rotation": [[2, 0, 0], [0, 2, 0], [0, 0, 2]]}, "[1].rotation"),
        ({"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "[1].rotation"),
        ({"k1": "0"}, "[1].k1"),
        ({"distortion": [0.1, 0]}, "[1].distortion"),
    ],
)
def test_a_bad_value_is_refused_by_file_and_field(tmp_path, change, field):
    assert_refused(written(tmp_path, VIEW, VIEW | {"img_name": "b"} | change), field)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"cx": 320.0, "cy": 240.0}, "an image 10 times as wide"),
        ({"cx": 64.0, "cy": 48.0, "fx": 80.0, "fy": 82.0}, "an image 2 times as wide"),
        ({"cx": -200.0, "cy": 24.0}, "a principal point far outside"),
        ({"fx": 4000.0, "fy": 4000.0}, "a field of view of 0.92°"),
        ({"cx": 70.0, "cy": 10.0}, None),
        ({"fx": 400.0, "fy": 400.0}, None),
    ],
)
def test_intrinsics_of_another_image_are_refused_by_the_factor(tmp_path, change, fault):
    path = written(tmp_path, VIEW | change)
    if fault is None:
        assert read_cameras(path)
        return
    with pytest.raises(InputError, match=fault):
        read_cameras(path)


def test_a_name_that_occurs_twice_is_refused_on_writing(tmp_path):
    (camera,) = read_cameras(written(tmp_path, VIEW))
    with pytest.raises(InputError, match="each name once, found 2 times 'a'"):
        write_cameras(tmp_path / "twice.json", [camera, replace(camera, width=65)])
    assert not (tmp_path / "twice.json").exists()
