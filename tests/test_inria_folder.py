import pytest

from gspure.errors import InputError
from gspure.model import read_model, write_model
from gspure.model.inria import point_cloud, saved_iterations, trained_background, training_arguments
from tests.models import blobs

CFG_ARGS = (
    r"Namespace(sh_degree=3, source_path='C:\\data\\bicycle', images='images', resolution=-1, white_background=False)"
)


@pytest.fixture
def trained(tmp_path):
    """An output folder with models of 7 and 9 Gaussians after 7000 and 30000 iterations."""
    for iteration, count in ((7000, 7), (30000, 9)):
        write_model(tmp_path / f"point_cloud/iteration_{iteration}/point_cloud.ply", blobs(count))
    (tmp_path / "cfg_args").write_text(CFG_ARGS)
    (tmp_path / "cameras.json").write_text("[]")
    return tmp_path


def test_the_newest_iteration_by_number_is_read(trained):
    assert list(saved_iterations(trained)) == [7000, 30000]
    assert len(read_model(trained)) == 9


def test_an_earlier_iteration_is_read_by_naming_its_folder(trained):
    assert len(read_model(trained / "point_cloud" / "iteration_7000")) == 7


def test_a_folder_without_a_model_is_refused(tmp_path):
    with pytest.raises(
        InputError, match=r"point_cloud: expected .*iteration_.*found no such file: the folder is empty"
    ):
        read_model(tmp_path)


def test_training_arguments_are_read(trained):
    assert training_arguments(trained) == {
        "sh_degree": 3,
        "source_path": r"C:\data\bicycle",
        "images": "images",
        "resolution": -1,
        "white_background": False,
    }


@pytest.mark.parametrize(("value", "shade"), [("True", 1.0), ("False", 0.0), ("1", 1.0), ("0", 0.0)])
def test_the_background_of_training_is_that_of_cfg_args(trained, value, shade):
    (trained / "cfg_args").write_text(f"Namespace(white_background={value})")
    assert trained_background(trained) == trained_background(point_cloud(trained)) == (shade, shade, shade)


def test_cfg_args_is_never_evaluated(trained):
    (trained / "cfg_args").write_text(f"Namespace(a=open({str(trained / 'made')!r}, 'w'), b=PosixPath('x'), c=[1, 2])")
    arguments = training_arguments(trained)
    assert not (trained / "made").exists()
    assert arguments == {"a": f"open({str(trained / 'made')!r}, 'w')", "b": "PosixPath('x')", "c": "[1, 2]"}
