import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.errors import InputError
from gspure.images import read_image
from gspure.model import read_model, write_model
from gspure.model.inria import cameras_file, point_cloud, saved_iterations, trained_background, training_arguments
from tests.models import blobs, camera

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


def test_the_cameras_stand_beside_the_model(trained):
    assert cameras_file(trained) == trained / "cameras.json"
    (trained / "cameras.json").unlink()
    with pytest.raises(InputError, match=r"cameras\.json: expected"):
        cameras_file(trained)


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


@pytest.mark.parametrize("command", ["attack", "purify"])
def test_derived_models_are_rendered_on_the_background_of_training(trained, command):
    (trained / "cfg_args").write_text("Namespace(white_background=True)")
    write_cameras(trained / "cameras.json", [camera(name=f"view_{i}") for i in range(2)])
    write_model(point_cloud(trained), blobs(40, size=(0.05, 0.1)))
    file, cameras = str(point_cloud(trained)), str(trained / "cameras.json")
    if command == "attack":
        made = trained / "attacked" / "point_cloud.ply"
        assert main(["attack", "unattacked", "--model", file, "--out", str(made)]) == 0
    else:
        made = trained / "results" / "purified.ply"
        settings = ["--min-samples", "2", "--min-cluster-size", "2", "--tau-c", "1e6", "--tau-n", "1e6"]
        assert main(["purify", file, "--cameras", cameras, "--out", str(made.parent), *settings]) == 0
    for source, out in ((str(trained), "before"), (str(made), "after")):
        assert main(["render", source, "--cameras", cameras, "--out", str(trained / out)]) == 0
    before, after = (read_image(trained / out / "view_0.png") for out in ("before", "after"))
    white = (before == 1).all(axis=-1)
    assert white.any()
    assert not white.all()
    np.testing.assert_allclose(after, before, atol=0.1)


def test_a_folder_without_cfg_args_has_no_training_arguments(tmp_path):
    assert training_arguments(tmp_path) == {}


def test_cfg_args_is_never_evaluated(trained):
    (trained / "cfg_args").write_text(f"Namespace(a=open({str(trained / 'made')!r}, 'w'), b=PosixPath('x'), c=[1, 2])")
    arguments = training_arguments(trained)
    assert not (trained / "made").exists()
    assert arguments == {"a": f"open({str(trained / 'made')!r}, 'w')", "b": "PosixPath('x')", "c": "[1, 2]"}


HUGE = f"Namespace(a=0x{'f' * 9999})"


def test_invalid_escape_sequences_in_cfg_args_are_kept_without_a_warning(trained):
    (trained / "cfg_args").write_text(r"Namespace(a='C:\data')")
    assert training_arguments(trained) == {"a": r"C:\data"}


@pytest.mark.parametrize(
    "text", ["", "sh_degree=3", "{'sh_degree': 3}", "dict(sh_degree=3)", "Namespace(", "(" * 5000, HUGE]
)
def test_another_text_in_cfg_args_is_refused(trained, text):
    (trained / "cfg_args").write_text(text)
    with pytest.raises(InputError, match=r"expected Namespace\(name=value, \.\.\.\)") as caught:
        training_arguments(trained)
    assert caught.value.source == str(trained / "cfg_args")


@given(content=st.one_of(st.binary(), st.text().map(str.encode), st.text().map(lambda t: f"Namespace(a={t})".encode())))
def test_no_cfg_args_breaks_the_reader(tmp_path_factory, content):
    folder = tmp_path_factory.mktemp("fuzz")
    (folder / "cfg_args").write_bytes(content)
    try:
        training_arguments(folder)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
