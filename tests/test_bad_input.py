"""Bad input: one line that names file and field, exit status 2, nothing half-written, before any work on a device."""

from pathlib import Path

import numpy as np
import pytest

from gspure.arrays import save_array
from gspure.cli import main
from gspure.images import write_image
from gspure.model import read_model, write_model
from gspure.provenance import bind_rows

COUNT = 30
COMMANDS = {
    "purify": "purify model.ply --cameras cameras.json --out out",
    "render": "render model.ply --cameras cameras.json --transform transform.npy --out out",
    "info": "info model.ply",
    "cameras": "cameras cameras.json --out out/cameras.json",
    "cameras orbit": "cameras orbit --model model.ply --out out/views.json",
    "attack": "attack plain_weight --model model.ply --weights weights.npy --out out/model.ply",
    "attack finetune": "attack finetune --model model.ply --cameras cameras.json --out out/model.ply",
    "attack gspure": "attack gspure --model model.ply --prune-mask prune_mask.npy --out out/model.ply",
    "metrics": "metrics a b --out out/metrics.csv",
}


@pytest.fixture
def folder(asset, monkeypatch):
    """A user's folder in which everything is as it should be. No device is needed."""
    monkeypatch.setattr("gspure.renderer.Renderer.__init__", lambda *_, **__: pytest.fail("renders first"))
    save("weights.npy", np.ones(COUNT, np.float32))
    save("prune_mask.npy", np.zeros(COUNT, bool))
    save("transform.npy", np.eye(4))
    rng = np.random.default_rng(0)
    for side in "ab":
        for view in "12":
            write_image(f"{side}/{view}.png", rng.random((20, 30, 3)))
    return asset


def refusal(folder, capsys, command):
    """Run a command that must be refused; return its one line."""
    before = sorted(path for path in folder.rglob("*") if path.is_file())
    assert main(command.split()) == 2
    error = [line for line in capsys.readouterr().err.splitlines() if not line.startswith(("device ", "metrics: "))]
    assert len(error) == 1, error
    assert sorted(path for path in folder.rglob("*") if path.is_file()) == before, "something was left behind"
    name = command.split()[0]
    assert error[0].startswith(f"gspure {name}: ")
    return error[0].removeprefix(f"gspure {name}: ")


def cut(path, size):
    Path(path).write_bytes(Path(path).read_bytes()[:size])


def save(name, array):
    save_array(Path(name), array)
    bind_rows(Path("model.ply"), Path(name))


def reorder():
    """Let the weights be those of another order of rows."""
    write_model("model.ply", read_model("model.ply")[::-1])


BAD = [  # what a command reads, a function that spoils it, and the place that a refusal names
    ("model.ply", lambda: cut("model.ply", -10), "model.ply: element vertex: "),
    ("model.ply", lambda: Path("model.ply").unlink(), "model.ply: no such file"),
    ("cameras.json", lambda: Path("cameras.json").write_text("[]"), "cameras.json: views: "),
    ("weights.npy", lambda: save("weights.npy", np.ones(3, np.float32)), "weights.npy: array: "),
    ("weights.npy", lambda: save("weights.npy", np.full(COUNT, np.nan, np.float32)), "weights.npy: array: "),
    ("weights.npy", reorder, "weights.npy: model: "),
    ("prune_mask.npy", lambda: save("prune_mask.npy", np.zeros(COUNT, np.int32)), "prune_mask.npy: array: "),
    ("transform.npy", lambda: save("transform.npy", np.diag([2.0, 2, 1, 1])), "transform.npy: array: "),
    ("a b", lambda: cut("b/2.png", 900), "b/2.png: file: "),
    ("a b", lambda: Path("a/2.png").unlink(), "a/2.png: file: "),
    ("a b", lambda: Path("b").rename("c"), "b: folder: "),
    ("a b", lambda: [file.unlink() for file in Path("b").iterdir()], "b: folder: "),
]
MATRIX = [
    pytest.param(command, spoil, place, id=f"{name} {place}")
    for file, spoil, place in BAD
    for name, command in COMMANDS.items()
    if file in command
]


@pytest.mark.parametrize(("command", "spoil", "place"), MATRIX)
def test_a_bad_file_is_refused_by_every_command_that_reads_it(folder, capsys, command, spoil, place):
    spoil()
    assert refusal(folder, capsys, command).startswith(place)


@pytest.mark.parametrize("command", ["purify", "render", "attack"])
def test_a_model_without_a_finite_row_is_refused(folder, capsys, command):
    write_model("model.ply", read_model("model.ply").with_columns({"y": np.full(COUNT, np.nan)}))
    assert refusal(folder, capsys, COMMANDS[command]).startswith("model.ply: y: expected finite numbers")


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ("cameras --resolution half", "resolution: value: expected native, photographs, 1/N or Wpx"),
        ("cameras --up 0 0 1", "cameras.json: source: expected orbit or shells, found a camera file and --up"),
        ("purify --device nope", "OpenCL: device: expected one that matches 'nope', found "),
    ],
)
def test_an_option_that_does_not_fit_is_refused(folder, capsys, options, line):
    command, _, option = options.partition(" ")
    assert refusal(folder, capsys, f"{COMMANDS[command]} {option}").startswith(line)


@pytest.mark.parametrize("command", ["cameras", "attack", "metrics"])
def test_an_output_that_cannot_be_written_is_named(folder, capsys, command):
    Path("file").touch()
    assert refusal(folder, capsys, COMMANDS[command].replace("out/", "file/")).startswith("file")
