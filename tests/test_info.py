import numpy as np
import pytest

from gspure.cli import main
from gspure.model import Gaussians, read_model, write_model
from gspure.model.signature import Signature
from gspure.model.summary import LEVELS, summarize
from tests.models import blobs


def report(capsys, *arguments):
    assert main(["info", *map(str, arguments)]) == 0
    return capsys.readouterr().out


@pytest.fixture
def corrupt(tmp_path):
    """A file of 6 Gaussians: rows 1 and 4 hold no numbers, row 2 no rotation, row 5 stands where row 3 does."""
    table = blobs(6).table
    table["x"][[1, 4]] = np.nan
    table["opacity"][4] = np.inf
    for i in range(4):
        table[f"rot_{i}"][2] = 0
    for name in "xyz":
        table[name][5] = table[name][3]
    write_model(tmp_path / "corrupt.ply", Gaussians(table))
    return tmp_path / "corrupt.ply"


def test_the_numbers_of_a_model_are_summarized():
    model = blobs(501)
    summary = summarize(model)
    assert (summary.gaussians, summary.sh_degree, summary.signature.name) == (501, 3, "VANILLA")
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
            summary.quantiles[name], np.sort(values)[[round(500 * q) for q in LEVELS]], rtol=1e-6
        )


def test_equal_positions_are_counted_however_zero_is_signed():
    means = np.array([[0.0, 1, 2], [-0.0, 1, 2], [0, 1, 3], [0, 1, 2]])
    table = blobs(4).with_columns(dict(zip("xyz", means.T, strict=True)))
    assert summarize(table).repeated_position_rows == 2


def test_bad_rows_are_counted_and_named(corrupt):
    summary = summarize(read_model(corrupt))
    assert summary.non_finite_rows == 2
    assert summary.non_finite_columns == {"x": (2, 1), "opacity": (1, 4)}
    assert summary.zero_quaternion_rows == 1
    assert summary.repeated_position_rows == 1
    assert (summary.gaussians, summary.sh_degree, summary.signature) == (6, 3, Signature.VANILLA)
    assert np.isfinite(summary.quantiles["x"]).all()


def test_quantiles_of_a_column_without_one_finite_value_are_absent(capsys, tmp_path):
    write_model(tmp_path / "m.ply", blobs(2).with_columns({"x": np.full(2, np.nan)}))
    assert "no finite value" in report(capsys, tmp_path / "m.ply")


def test_further_properties_are_shown_as_series(capsys, tmp_path):
    extras = {f"semantic_{i}": np.zeros(3) for i in range(16)} | {"tag": np.zeros(3)}
    table = blobs(3, sh_degree=0).table
    columns = [name for name in table.dtype.names if not name.startswith("f_")]
    hider = np.empty(3, [(name, "<f4") for name in (*columns, *extras)])
    for name in columns:
        hider[name] = table[name]
    for name, column in extras.items():
        hider[name] = column
    write_model(tmp_path / "m.ply", Gaussians(hider))
    text = report(capsys, tmp_path / "m.ply")
    assert "GS-Hider" in text
    assert "no spherical harmonics" in text
    assert "further properties: semantic_0..15 tag\n" in text


def test_rows_that_are_anchors_are_called_so(capsys, tmp_path):
    anchors = np.zeros(3, [(name, "<f4") for name in (*blobs(1).table.dtype.names, "f_anchor_feat_0", "f_offset_0")])
    anchors["rot_0"] = 1
    write_model(tmp_path / "m.ply", Gaussians(anchors))
    text = report(capsys, tmp_path / "m.ply")
    assert "3 anchors, " in text
    assert "Gaussians" not in text


def test_info_on_a_training_folder_shows_its_arguments(capsys, tmp_path):
    write_model(tmp_path / "point_cloud/iteration_30000/point_cloud.ply", blobs(2).with_comment("made by hand"))
    (tmp_path / "cfg_args").write_text("Namespace(sh_degree=3, eval=True)")
    text = report(capsys, tmp_path)
    assert text.startswith(str(tmp_path / "point_cloud/iteration_30000/point_cloud.ply"))
    assert "  comment: made by hand\n  trained with eval = True\n  trained with sh_degree = 3\n" in text


def test_signalling_numbers_give_no_warning(tmp_path):
    table = blobs(6).table
    for name in ("x", "opacity", "scale_0", "rot_1"):
        table[name][2:4] = np.array([0x7F800001, 0xFF800001], np.uint32).view(np.float32)
    assert summarize(Gaussians(table)).non_finite_rows == 2


def test_text_from_the_files_cannot_control_the_terminal(tmp_path, capsys):
    model = tmp_path / "point_cloud" / "iteration_1" / "point_cloud.ply"
    write_model(model, blobs(3).with_comment("\x1b[2J"))
    (tmp_path / "cfg_args").write_text(r"Namespace(a='\x1b[31m\n\u202e')")
    assert all(line.isprintable() for line in report(capsys, tmp_path).split("\n"))
