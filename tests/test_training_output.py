"""The folder that training leaves, opened as other tools open it."""

import numpy as np
import pytest

from gspure.cameras import read_cameras, split
from gspure.model import read_model
from gspure.model.inria import point_cloud, training_arguments
from gspure.model.ply import read_point_ply
from gspure.training.dataset import read_dataset
from gspure.training.output import as_gaussians, write_output
from tests.training_cases import colmap_project, parameters, ring

POINTS = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))


@pytest.fixture
def written(tmp_path):
    dataset = read_dataset(colmap_project(tmp_path / "project", ring(17), POINTS), "16px")
    folder = tmp_path / "trained"
    return folder, dataset, write_output(folder, dataset, parameters(30), 70, (1.0, 1.0, 1.0), place=folder)


def test_the_table_holds_raw_parameters_bit_for_bit():
    raw = parameters(30)
    model = as_gaussians(raw)
    np.testing.assert_array_equal(model.means, raw.means)
    np.testing.assert_array_equal(model.quats, raw.quats)
    np.testing.assert_array_equal(model.columns("scale_0", "scale_1", "scale_2"), raw.log_scales)
    np.testing.assert_array_equal(model.columns("opacity")[:, 0], raw.opacity_logits)
    np.testing.assert_array_equal(model.sh_coeffs, raw.sh_coeffs)
    assert len(model.table.dtype.names) == 62


def test_the_folder_is_read_like_one_of_3dgs(written):
    folder, _, model = written
    assert point_cloud(folder) == model == folder / "point_cloud" / "iteration_70" / "point_cloud.ply"
    assert len(read_model(folder)) == 30
    arguments = training_arguments(folder)
    assert arguments["sh_degree"] == 3
    assert (arguments["white_background"], arguments["eval"], arguments["resolution"]) == (True, True, 16)


def test_cameras_list_test_views_first_and_split_as_they_were_trained(written):
    folder, dataset, _ = written
    cameras = read_cameras(folder)
    assert [c.name for c in cameras] == [c.name for c in [*dataset.test, *dataset.train]]
    assert [[c.name for c in part] for part in split(cameras)] == [
        [c.name for c in part] for part in (dataset.train, dataset.test)
    ]
    assert {(c.width, c.height) for c in cameras} == {(16, 12)}
    assert cameras[0].image.samefile(dataset.test[0].image)


def test_the_initial_points_are_kept(written):
    folder, dataset, _ = written
    np.testing.assert_array_equal(read_point_ply(folder / "input.ply")[0], dataset.xyz.astype(np.float32))
