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


def test_an_incomplete_iteration_is_skipped(trained):
    (trained / "point_cloud" / "iteration_40000").mkdir()
    (trained / "point_cloud" / "iteration_best").mkdir()
    assert point_cloud(trained) == trained / "point_cloud" / "iteration_30000" / "point_cloud.ply"


def test_a_folder_without_a_model_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"point_cloud: expected .*iteration_.*found no such file"):
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


@pytest.mark.parametrize("value", ["'True'", "2", "None", "white"])
def test_a_background_that_is_neither_true_nor_false_is_refused(trained, value):
    (trained / "cfg_args").write_text(f"Namespace(white_background={value})")
    with pytest.raises(InputError, match="cfg_args: white_background: expected True or False"):
        trained_background(trained)


def test_a_folder_without_cfg_args_has_no_training_arguments(tmp_path):
    assert training_arguments(tmp_path) == {}


def test_cfg_args_is_never_evaluated(trained):
    (trained / "cfg_args").write_text(f"Namespace(a=open({str(trained / 'made')!r}, 'w'), b=PosixPath('x'), c=[1, 2])")
    arguments = training_arguments(trained)
    assert not (trained / "made").exists()
    assert arguments == {"a": f"open({str(trained / 'made')!r}, 'w')", "b": "PosixPath('x')", "c": "[1, 2]"}


HUGE = f"Namespace(a=0x{'f' * 9999})"


@pytest.mark.parametrize(
    "text", ["", "sh_degree=3", "{'sh_degree': 3}", "dict(sh_degree=3)", "Namespace(", "(" * 5000, HUGE]
)
def test_another_text_in_cfg_args_is_refused(trained, text):
    (trained / "cfg_args").write_text(text)
    with pytest.raises(InputError, match=r"expected Namespace\(name=value, \.\.\.\)") as caught:
        training_arguments(trained)
    assert caught.value.source == str(trained / "cfg_args")
