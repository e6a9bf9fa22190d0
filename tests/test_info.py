"""The summary of a model's numbers, doubts about them, and the folder of a training run."""

import os
import subprocess
import sys

import numpy as np
import pytest

from gspure.cameras import write_cameras
from gspure.cameras.worlds import shifted
from gspure.cli import main
from gspure.errors import InputError
from gspure.images import read_image
from gspure.model import Gaussians, read_model, write_model
from gspure.model.gaussians import SCALES
from gspure.model.inria import point_cloud, saved_iterations, trained_background, training_arguments
from gspure.model.summary import QUANTILE_LEVELS, doubts, summarize
from tests.attack_cases import anchors, features
from tests.models import blobs, camera, tilted_camera
from tests.test_ply import header


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
    places = [round(500 * level) for level in QUANTILE_LEVELS]
    for name, values in expected.items():
        np.testing.assert_allclose(summary.quantiles[name], np.sort(values)[places], rtol=1e-6)


def test_bad_rows_are_counted_and_named():
    """Rows 1 and 4 hold no numbers, row 2 no rotation, row 5 stands where row 3 does."""
    table = blobs(6).table
    table["x"][[1, 4]] = np.nan
    table["opacity"][4] = np.nan
    table["opacity"][[0, 5]] = (-np.inf, np.inf)  # opacities of 0 and 1
    table["scale_0"][0] = -np.inf  # a size of 0
    for i in range(4):
        table[f"rot_{i}"][2] = 0
    for name in "xyz":
        table[name][5] = table[name][3]
    summary = summarize(Gaussians(table))
    assert summary.non_finite_rows == 2
    assert summary.non_finite_columns == {"x": (2, 1), "opacity": (1, 4)}
    assert summary.zero_quaternion_rows == 1
    assert summary.repeated_position_rows == 1
    assert np.isfinite(summary.quantiles["x"]).all()


def test_text_from_the_files_cannot_control_the_terminal(tmp_path, capsys):
    write_model(tmp_path / "point_cloud" / "iteration_1" / "point_cloud.ply", blobs(3).with_comment("\x1b[2J"))
    (tmp_path / "cfg_args").write_text(r"Namespace(a='\x1b[31m\n\u202e')")
    assert main(["info", str(tmp_path)]) == 0
    assert all(line.isprintable() for line in capsys.readouterr().out.split("\n"))


def test_a_terminal_of_ascii_gets_escapes(tmp_path):
    write_model(tmp_path / "model.ply", blobs(2).with_comment("exporté"))
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "LANG": "C"}
    command = [sys.executable, "-m", "gspure", "info", str(tmp_path / "model.ply")]
    assert b"export\\xe9" in subprocess.run(command, env=environment, capture_output=True, check=True).stdout


@pytest.fixture
def trained(tmp_path):
    """An output folder with models of 7 and 9 Gaussians after 7000 and 30000 iterations."""
    for iteration, count in ((7000, 7), (30000, 9)):
        write_model(tmp_path / f"point_cloud/iteration_{iteration}/point_cloud.ply", blobs(count))
    return tmp_path


def test_the_newest_iteration_by_number_is_read_or_the_one_whose_folder_is_named(trained):
    assert list(saved_iterations(trained)) == [7000, 30000]
    assert len(read_model(trained)) == 9
    assert len(read_model(trained / "point_cloud" / "iteration_7000")) == 7


def test_a_folder_without_a_model_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"point_cloud: expected .*iteration_.*found an empty folder"):
        read_model(tmp_path)


@pytest.mark.parametrize(("value", "shade"), [("True", 1.0), ("False", 0.0), ("1", 1.0), ("0", 0.0)])
def test_the_background_of_training_is_that_of_cfg_args(trained, value, shade):
    (trained / "cfg_args").write_text(f"Namespace(white_background={value})")
    assert trained_background(trained) == trained_background(point_cloud(trained)) == (shade, shade, shade)


def test_cfg_args_is_read_and_never_evaluated(trained):
    call = f"open({str(trained / 'made')!r}, 'w')"
    text = rf"Namespace(a={call}, b=PosixPath('x'), c=[1, 2], path='C:\\data\\bicycle', resolution=-1, white=False)"
    (trained / "cfg_args").write_text(text)
    texts = {"a": call, "b": "PosixPath('x')", "c": "[1, 2]"}
    assert training_arguments(trained) == {**texts, "path": r"C:\data\bicycle", "resolution": -1, "white": False}
    assert not (trained / "made").exists()


VIEWS = [camera(32, 24, name="a"), tilted_camera(32, 24, name="b")]


def scaled(model, factor):
    """The model in other units."""
    values = {name: model.table[name] + np.log(factor) for name in SCALES}
    return model.with_columns(values | {name: factor * model.table[name] for name in "xyz"})


def linear(model):
    return model.with_columns({name: np.exp(model.table[name]) for name in SCALES})


def uniform(size, extent):
    """Round Gaussians of one size, as made from points."""
    model = blobs(200)
    values = {name: np.full(200, np.log(size)) for name in SCALES}
    return model.with_columns(values | {name: extent / 8 * model.table[name] for name in "xyz"})


PLAUSIBLE = {
    **{f"scaled by {factor:g}": scaled(blobs(200), factor) for factor in (1e-3, 0.1, 1, 10, 60, 1e3, 1e6)},
    **{f"round, {size:g} in {extent:g}": uniform(size, extent) for size, extent in ((1, 100), (2, 1000), (0.01, 1))},
    "anchors": anchors(50),
    "features": features(50),
    "one row": blobs(1),
    "opacity 1/2": blobs(50).with_columns({"opacity": np.zeros(50)}),
    "infinities": blobs(50).with_columns(
        {"opacity": np.repeat([np.inf, -np.inf], 25), "scale_0": np.full(50, -np.inf)}
    ),
    "a kilometre away": blobs(50).with_columns({"x": blobs(50).table["x"] + 1000}),
    "no numbers": blobs(3).with_columns({"x": np.full(3, np.nan)}),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("model", PLAUSIBLE.values(), ids=PLAUSIBLE)
def test_ordinary_models_raise_no_doubt(model):
    assert doubts(model) == []


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("model", [*(scaled(blobs(200), factor) for factor in (1e-2, 1, 1e5)), uniform(0.01, 5)])
def test_linear_scales_are_named_with_their_inverse(model):
    assert "ln(scale)" in doubts(linear(model))[0]


@pytest.mark.parametrize("value", [None, 1.0])
def test_activated_opacities_are_named_with_their_inverse(value):
    opacities = blobs(200).opacities if value is None else np.full(200, value)
    (line,) = doubts(blobs(200).with_columns({"opacity": opacities}))
    assert "ln(opacity / (1 - opacity))" in line
    assert doubts(linear(blobs(200)).with_columns({"opacity": opacities}))[0].count("where 3DGS has") == 2


@pytest.mark.parametrize(("offset", "is_coarse"), [(500_000, True), (5e6, True), (1e4, False)])
def test_coordinates_that_float32_rounds_to_more_than_a_part_of_the_gaussians_are_named(offset, is_coarse):
    model = blobs(200, size=(0.05, 0.4))
    lines = doubts(model.with_columns({"y": model.table["y"] + offset}))
    assert len(lines) == is_coarse
    assert all("float32 steps" in line for line in lines)


def test_commands_print_doubts_once(tmp_path, capsys):
    write_model(tmp_path / "m.ply", linear(blobs(50)))
    write_cameras(tmp_path / "cameras.json", VIEWS)
    for command, *more in (["info"], ["render"], ["purify", "--no-figures"]):
        views = ["--cameras", str(tmp_path / "cameras.json"), "--out", str(tmp_path / command)]
        main([command, str(tmp_path / "m.ply"), *(views if command != "info" else []), *more])
        assert capsys.readouterr().err.count("ln(scale)") == 1


@pytest.mark.parametrize("offset", [(500_000.4, 5_400_000.7, 300.2), (0, 0, -2e7), (3.2, 0, 0)])
@pytest.mark.parametrize("encoding", ["ascii", "binary_big_endian"])
def test_coordinates_of_many_digits_keep_them_and_cameras_follow(tmp_path, capsys, encoding, offset):
    model = blobs(60, sh_degree=0)
    table = model.table.astype([(name, "<f8" if name in "xyz" else "<f4") for name in model.names])
    for name, start in zip("xyz", offset, strict=True):
        table[name] += start
    rows = "\n".join(" ".join(map(repr, row)) for row in table.tolist()).encode()
    body = rows if encoding == "ascii" else table.astype(table.dtype.newbyteorder(">")).tobytes()
    (tmp_path / "far.ply").write_bytes(header(table.dtype, 60, encoding) + body)
    write_model(tmp_path / "near.ply", model)
    write_cameras(tmp_path / "far.json", shifted(VIEWS, np.array(offset)))
    write_cameras(tmp_path / "near.json", VIEWS)
    images = []
    for name in ("near", "far"):
        paths = [tmp_path / f"{name}.ply", "--cameras", tmp_path / f"{name}.json", "--out", tmp_path / name]
        assert main(["render", *map(str, paths)]) == 0
        images.append([read_image(tmp_path / name / f"{view.name}.png") for view in VIEWS])
    np.testing.assert_allclose(*images, atol=2 / 255)
    warnings = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning")]
    assert ["become relative to" in line for line in warnings] == [max(offset) > 100 or min(offset) < -100]
