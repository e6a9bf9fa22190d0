"""Where cameras and photographs of a capture may lie."""

import shutil

import numpy as np
import pytest

from gspure.cameras import read_cameras, write_cameras
from gspure.cameras.reading import default_cameras
from gspure.errors import InputError
from gspure.files import write_json
from gspure.training.dataset import read_dataset
from gspure.workflow.inputs import camera_files
from tests.training_cases import colmap_project, ring

POINTS = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))


@pytest.fixture
def project(tmp_path):
    return colmap_project(tmp_path / "project", ring(9), POINTS)


def moved(project, places):
    """Move files and folders of a project: ``old new`` each; ``old/*`` moves all files."""
    for old, new in (place.split() for place in places):
        for path in sorted(project.glob(old)):
            target = project / new.replace("*", path.stem)
            target = target / path.name if new.endswith("/") else target
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(path, target)
    return project


@pytest.mark.parametrize(
    "places",
    [
        ["sparse/0/* dense/0/sparse/", "images dense/0/images"],
        ["sparse/0/* colmap/sparse/0/"],
        ["sparse/0/* export/registration/"],
        ["sparse/0 sparse/1"],
        ["sparse/0/* ./", "images/* ./"],
        ["sparse/0/* ./", "images/* photos/"],
        ["images images_4"],
        ["images Images"],
        ["images undistorted/images"],
        ["images/* images/*.JPG"],
        ["images/* input/day/"],
    ],
)
def test_cameras_and_photographs_are_found_near_their_usual_places(project, places, monkeypatch):
    dataset = read_dataset(moved(project, places), "native")
    assert len(dataset.train) == 7
    assert np.array_equal(dataset.xyz, POINTS)
    assert all(view.image.stem.lower() == view.name for view in dataset.train)
    assert len(camera_files(str(project))) == 3
    monkeypatch.chdir(project)
    assert len(read_dataset(".", "native").train) == 7


def test_absolute_names_from_another_machine_are_found(project):
    file = project / "sparse" / "0" / "images.txt"
    file.write_text(file.read_text().replace("orbit", "/home/someone/capture/images/orbit"))
    assert all(view.image.is_file() for view in read_cameras(project))


def test_masks_are_not_taken_for_photographs(project):
    moved(project, ["images masks"])
    assert {view.image for view in read_cameras(project)} == {None}


@pytest.mark.parametrize("place", ["masks", "sparse/mask", "mask_path"])
def test_masks_that_nothing_uses_are_named(project, place, capsys):
    if place == "mask_path":
        shutil.rmtree(project / "sparse")
        frames = [{"file_path": "images/a.png", place: "masks/a.png", "transform_matrix": np.eye(4).tolist()}]
        write_json(project / "transforms.json", {"w": 32, "h": 24, "fl_x": 30.0, "frames": frames})
    else:
        (project / place).mkdir()
    read_cameras(project)
    assert capsys.readouterr().err.count("masked pixels count in training and metrics") == 1


def test_several_captures_are_named(project):
    moved(project, ["sparse/0 a/sparse/0"])
    shutil.copytree(project / "a", project / "b")
    with pytest.raises(InputError, match=r"found a/sparse/0, b/sparse/0 \(name one of them\)"):
        read_cameras(project)


@pytest.mark.parametrize(
    ("places", "hint"),
    [(["images elsewhere"], "--images DIR"), (["images/orbit_000.png ../gone.png"], "--skip-missing` leaves out")],
)
def test_the_hint_about_missing_photographs_can_help(project, places, hint):
    for skip_missing in (False, "skip" not in hint):
        with pytest.raises(InputError, match=hint):
            read_dataset(moved(project, places), "native", skip_missing=skip_missing)


def test_default_cameras_are_beside_the_model_or_in_its_run(tmp_path):
    beside = tmp_path / "run" / "point_cloud" / "iteration_7"
    beside.mkdir(parents=True)
    (beside / "point_cloud.ply").touch()
    assert default_cameras(beside / "point_cloud.ply") == "orbit"
    write_cameras(tmp_path / "run" / "cameras.json", ring(2))
    for model in (beside / "point_cloud.ply", tmp_path / "run"):
        assert default_cameras(model) == tmp_path / "run"
    write_cameras(beside / "cameras.json", ring(2))
    assert default_cameras(tmp_path / "run") == beside
