"""What training refuses before it begins, and what it reads."""

import numpy as np
import pytest
from PIL import Image

from gspure.cameras import read_cameras
from gspure.cameras.fitting import Cloud
from gspure.cameras.worlds import in_world_of, shifted
from gspure.errors import InputError
from gspure.files import read_json, write_json
from gspure.model import read_model
from gspure.model.ply import offset_comment, read_point_ply, write_point_ply
from gspure.training.dataset import read_dataset, read_photographs
from gspure.training.initialization import gaussians_at
from gspure.training.output import write_output
from tests.models import gaussians
from tests.training_cases import blender_scene, colmap_project, ring, turned_away

POINTS = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))


@pytest.fixture
def project(tmp_path):
    return colmap_project(tmp_path / "project", ring(), POINTS)


def refusal(source, scale="native", **settings):
    with pytest.raises(InputError) as caught:
        read_dataset(source, scale, **settings)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_colmap_project_is_read(project):
    dataset = read_dataset(project, "16px")
    assert [view.name for view in dataset.test] == ["orbit_000", "orbit_008"]
    assert len(dataset.train) == 7
    np.testing.assert_allclose(dataset.xyz, POINTS)
    assert dataset.rgb.tolist() == [[200, 100, 50]] * 20
    assert {image.shape for image in read_photographs(dataset.train)} == {(12, 16, 3)}


def test_the_extent_is_that_of_the_training_cameras(project):
    dataset = read_dataset(project, "native")
    centres = np.array([view.centre for view in dataset.train])
    expected = 1.1 * max(np.linalg.norm(centre - centres.mean(axis=0)) for centre in centres)
    assert dataset.extent == pytest.approx(expected)


@pytest.mark.parametrize(
    ("views", "points", "refused"),
    [
        ([turned_away(view) for view in ring()], POINTS, "some that see points, found all look away from them"),
        ([turned_away(view) for view in ring(3)], [], "overlapping ones, or at least 4 points, found neither"),
        (ring(1), POINTS, "several, from different places, found none"),
        (ring(2), POINTS, "several, from different places, found 1 in one place"),
    ],
)
def test_views_from_which_nothing_can_be_trained_are_refused(tmp_path, views, points, refused):
    source = colmap_project(tmp_path / "project", views, points)
    assert f"training views: expected {refused}" in refusal(source)


def test_points_read_back_are_those_written(tmp_path):
    rgb = np.random.default_rng(1).integers(256, size=(20, 3), dtype=np.uint8)
    write_point_ply(tmp_path / "input.ply", POINTS, rgb)
    xyz, colours = read_point_ply(tmp_path / "input.ply")
    np.testing.assert_array_equal(xyz, POINTS.astype(np.float32))
    np.testing.assert_array_equal(colours, rgb)


@pytest.fixture
def blender(tmp_path):
    """Five training views, three of each held-out split, all 32x24."""
    views = ring(11)
    splits = {"train": views[:5], "val": views[5:8], "test": views[8:]}
    return blender_scene(tmp_path / "blender", splits, gaussians(means=POINTS, scales=0.1, opacities=0.9))


def names(views):
    return [view.name for view in views]


@pytest.fixture
def nerfstudio(blender):
    """Return a function that writes a transforms.json of the five training views, with lists of files."""
    content = read_json(blender / "transforms_train.json")
    files = [frame["file_path"] for frame in content["frames"]]

    def write(**lists):
        path = blender / "transforms.json"
        write_json(path, content | {f"{name}_filenames": [files[i] for i in rows] for name, rows in lists.items()})
        return path

    return write


@pytest.mark.parametrize(
    ("lists", "train", "test"),
    [
        ({"train": [0, 1, 2], "test": [3, 4]}, [0, 1, 2], [3, 4]),
        ({"train": [0, 1, 2], "val": [4]}, [0, 1, 2], [4]),
        ({"test": [3]}, [0, 1, 2, 4], [3]),
    ],
)
def test_the_file_lists_of_nerfstudio_split_the_views(nerfstudio, lists, train, test):
    dataset = read_dataset(nerfstudio(**lists), "native")
    assert names(dataset.train) == [f"train_r_{i}" for i in train]
    assert names(dataset.test) == [f"train_r_{i}" for i in test]


@pytest.mark.parametrize("shade", [0.0, 0.4, 1.0])
def test_transparent_photographs_are_composited_on_the_background(blender, shade):
    views = read_dataset(blender, "native").train
    for view, image in zip(views, read_photographs(views, (shade, 0, 1)), strict=True):
        red, _, blue, alpha = np.moveaxis(np.asarray(Image.open(view.image)) / 255, -1, 0)
        assert 0 < alpha.mean() < 0.9
        np.testing.assert_allclose(image[..., 0], red * alpha + shade * (1 - alpha), atol=1.5 / 255)
        np.testing.assert_allclose(image[..., 2], blue * alpha + (1 - alpha), atol=1.5 / 255)


@pytest.mark.parametrize("offset", [(456789, 5432100, 86), (0, 1e4, 0), (-3e7, 3e7, 0)])
def test_a_capture_far_from_the_origin_is_moved_to_it(project, tmp_path, capsys, offset):
    near = read_dataset(project, "native")
    assert not near.offset.any()
    far = read_dataset(colmap_project(tmp_path / "far", shifted(ring(), np.array(offset)), POINTS + offset), "native")
    assert capsys.readouterr().err.count("training around") == 1
    rest = np.array(offset) - far.offset
    assert (np.abs(rest) < 2).all()
    np.testing.assert_allclose(far.xyz, near.xyz + rest, atol=1e-7)
    for there, here in zip(far.train, near.train, strict=True):
        np.testing.assert_allclose(there.centre, here.centre + rest, atol=1e-7)


def test_a_model_around_an_offset_is_seen_by_the_cameras_of_its_capture(tmp_path):
    offset = np.array([456789.0, 5432100, 86])
    source = colmap_project(tmp_path / "far", shifted(ring(), offset), POINTS + offset)
    data = read_dataset(source, "native")
    write_output(tmp_path / "out", data, gaussians_at(data.xyz, data.rgb), 1, (0, 0, 0), place=tmp_path / "out")
    assert read_model(tmp_path / "out").comments == (offset_comment(data.offset),)
    for cameras in (source, tmp_path / "out" / "cameras.json"):
        views = in_world_of(tmp_path / "out", read_cameras(cameras), cameras)
        assert Cloud(read_model(tmp_path / "out")).share_covered(views) > 0.3


def test_photographs_that_exif_data_turn_are_mentioned(project, capsys):
    exif = Image.Exif()
    exif[0x112] = 6
    for number, file in enumerate(sorted((project / "images").iterdir())):
        Image.open(file).save(file.with_suffix(".jpg"), **({"exif": exif} if number < 2 else {}))
        file.unlink()
    read_dataset(project, "native")
    assert "2 of 9 photographs are turned, such as orbit_000: EXIF orientation 6 is ignored" in capsys.readouterr().err
    Image.new("RGB", (24, 32)).save(project / "images" / "orbit_001.jpg", exif=exif)
    assert "orbit_001.image: expected the shape of its camera, 32x24, found 24x32 (EXIF" in refusal(project, "16px")
