"""The summary of a model's numbers, and the folder of a training run."""

import os
import subprocess
import sys

import numpy as np
import pytest

from gspure.cli import main
from gspure.errors import InputError
from gspure.model import Gaussians, read_model, write_model
from gspure.model.inria import point_cloud, saved_iterations, trained_background, training_arguments
from gspure.model.summary import QUANTILE_LEVELS, summarize
from tests.models import blobs


def report(capsys, *arguments):
    assert main(["info", *map(str, arguments)]) == 0
    return capsys.readouterr().out


@pytest.fixture
def corrupt(tmp_path):
    """A file of 6 Gaussians: rows 1 and 4 hold no numbers, row 2 no rotation, row 5 stands where row 3 does."""
    table = blobs(6).table
    table["x"][[1, 4]] = np.nan
    table["opacity"][4] = np.nan
    table["opacity"][[0, 5]] = (-np.inf, np.inf)  # opacities of 0 and 1
    table["scale_0"][0] = -np.inf  # a size of 0
    for i in range(4):
        table[f"rot_{i}"][2] = 0
    for name in "xyz":
        table[name][5] = table[name][3]
    write_model(tmp_path / "corrupt.ply", Gaussians(table))
    return tmp_path / "corrupt.ply"


def test_the_numbers_of_a_model_are_summarized():
    model = blobs(501)
    summary = summarize(model)
    assert summary.kind.startswith("vanilla 3DGS")
    assert (summary.non_finite_rows, summary.zero_quaternion_rows, summary.repeated_position_rows) == (0, 0, 0)
    assert summary.further_columns == ()
    expected = {
        "x": model.means[:, 0],
        "opacity": model.opacities,
        "largest_scale": model.scales.max(axis=1),
        "smallest_scale": model.scales.min(axis=1),
    }
    for name, values in expected.items():
        np.testing.assert_allclose(
            summary.quantiles[name], np.sort(values)[[round(500 * q) for q in QUANTILE_LEVELS]], rtol=1e-6
        )


def test_bad_rows_are_counted_and_named(corrupt):
    summary = summarize(read_model(corrupt))
    assert summary.non_finite_rows == 2
    assert summary.non_finite_columns == {"x": (2, 1), "opacity": (1, 4)}
    assert summary.zero_quaternion_rows == 1
    assert summary.repeated_position_rows == 1
    assert np.isfinite(summary.quantiles["x"]).all()


def test_info_on_a_training_folder_shows_its_arguments(capsys, tmp_path):
    write_model(tmp_path / "point_cloud/iteration_30000/point_cloud.ply", blobs(2).with_comment("made by hand"))
    (tmp_path / "cfg_args").write_text("Namespace(sh_degree=3, eval=True)")
    text = report(capsys, tmp_path)
    assert text.startswith(str(tmp_path / "point_cloud/iteration_30000/point_cloud.ply"))
    assert "  comment: made by hand\n  trained with eval = True\n  trained with sh_degree = 3\n" in text


def test_text_from_the_files_cannot_control_the_terminal(tmp_path, capsys):
    model = tmp_path / "point_cloud" / "iteration_1" / "point_cloud.ply"
    write_model(model, blobs(3).with_comment("\x1b[2J"))
    (tmp_path / "cfg_args").write_text(r"Namespace(a='\x1b[31m\n\u202e')")
    assert all(line.isprintable() for line in report(capsys, tmp_path).split("\n"))


def test_a_terminal_of_ascii_gets_escapes(tmp_path):
    write_model(tmp_path / "model.ply", blobs(2).with_comment("exporté"))
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "LANG": "C"}
    command = [sys.executable, "-m", "gspure", "info", str(tmp_path / "model.ply")]
    assert b"export\\xe9" in subprocess.run(command, env=environment, capture_output=True, check=True).stdout


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


def test_the_newest_iteration_by_number_is_read_or_the_one_whose_folder_is_named(trained):
    assert list(saved_iterations(trained)) == [7000, 30000]
    assert len(read_model(trained)) == 9
    assert len(read_model(trained / "point_cloud" / "iteration_7000")) == 7


def test_a_folder_without_a_model_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"point_cloud: expected .*iteration_.*found an empty folder"):
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
