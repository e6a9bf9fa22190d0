"""Bad input: one line that names file and field, exit status 2, and nothing half-written."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import save_array, write_record
from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.images import write_image
from gspure.method.clusters import Clusters, write_clusters
from gspure.model import Gaussians, read_model, write_model
from tests.models import blobs, camera

ROOT = Path(__file__).parents[1]
COUNT = 60
COMMANDS = {
    "purify": "purify model.ply --cameras cameras.json --out out",
    "purify orbit": "purify model.ply --cameras orbit --out out",
    "render": "render model.ply --cameras cameras.json --out out",
    "info": "info model.ply",
    "cameras": "cameras cameras.json --out out.json",
    "cameras orbit": "cameras orbit --model model.ply --out out.json",
    "contributions": "contributions --model model.ply --cameras cameras.json --stages out --index out.tsv",
    "features": "features --model model.ply --weights weights.npy --out out.npy",
    "attack": "attack plain_weight --model model.ply --weights weights.npy --out out.ply --removed out.npy",
    "prune": "prune --clusters clusters.npz --weights weights.npy --out out.npy",
    "metrics": "metrics a b --out out.csv",
    "figures": "figures model --model model.ply --weights weights.npy --clusters clusters.npz "
    "--cameras cameras.json --out out",
}
OF_MODEL = [name for name, command in COMMANDS.items() if "model.ply" in command]
OF_CAMERAS = [name for name, command in COMMANDS.items() if "cameras.json" in command]
OF_NUMBERS = [name for name in OF_MODEL if name not in {"info", "cameras orbit"}]  # these two pass over bad rows
OF_WEIGHTS = [name for name, command in COMMANDS.items() if "weights.npy" in command]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A user's folder in which everything is as it should be; it is the current one."""
    monkeypatch.chdir(tmp_path)
    write_model("model.ply", blobs(COUNT))
    write_cameras("cameras.json", [camera(40, 30, name=f"view_{i}") for i in range(9)])
    for name, array in {"weights": np.ones(COUNT, np.float32), "mask": np.zeros(COUNT, bool)}.items():
        save_array(Path(f"{name}.npy"), array)
    write_clusters(Path("clusters.npz"), Clusters(np.zeros(COUNT, np.int32), 0), {})
    rng = np.random.default_rng(0)
    for side in "ab":
        for view in "12":
            write_image(f"{side}/{view}.png", rng.random((20, 30, 3)))
    return tmp_path


def refusal(folder, capsys, command):
    """Run a command that must be refused; returns its one line."""
    before = sorted(folder.rglob("*"))
    assert main(command.split()) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    assert sorted(folder.rglob("*")) == before, "something was left behind"
    name = command.split()[0]
    assert error.startswith(f"gspure {name}: ")
    return error.removeprefix(f"gspure {name}: ")


def cut(path, size):
    Path(path).write_bytes(Path(path).read_bytes()[:size])


def spoil_row(**values):
    """Let row 7 of the model hold these values."""
    model = read_model("model.ply")
    write_model(
        "model.ply",
        model.with_columns({n: np.where(np.arange(COUNT) == 7, v, model.table[n]) for n, v in values.items()}),
    )


def in_doubles():
    table = read_model("model.ply").table
    write_model("model.ply", Gaussians(table.astype([(name, "<f8") for name in table.dtype.names])))


def without_rows():
    header, _, _ = Path("model.ply").read_bytes().partition(b"end_header\n")
    Path("model.ply").write_bytes(header.replace(b"vertex 60", b"vertex 0") + b"end_header\n")


BAD_MODELS = {
    "truncated": (lambda: cut("model.ply", -10), "model.ply: element vertex: expected 60 rows, found room for 59"),
    "header cut": (lambda: cut("model.ply", 100), "model.ply: file: expected a 3DGS .ply"),
    "empty": (lambda: cut("model.ply", 0), "model.ply: file: expected a 3DGS .ply"),
    "wrong type": (in_doubles, "model.ply: x: expected a float32 property, found float64"),
    "no Gaussians": (without_rows, "model.ply: element vertex: expected at least one row, found 0 rows"),
    "missing": (lambda: Path("model.ply").unlink(), "model.ply: no such file"),
}
BAD_ROWS = {"NaN position": {"y": np.nan}, "infinite scale": {"scale_1": np.inf}, "NaN colour": {"f_rest_3": np.nan}}


@pytest.mark.parametrize("command", OF_MODEL)
@pytest.mark.parametrize(("spoil", "line"), BAD_MODELS.values(), ids=BAD_MODELS)
def test_a_bad_model_is_refused_by_every_command(folder, capsys, command, spoil, line):
    spoil()
    assert refusal(folder, capsys, COMMANDS[command]).startswith(line)


@pytest.mark.parametrize("command", OF_NUMBERS)
@pytest.mark.parametrize("values", BAD_ROWS.values(), ids=BAD_ROWS)
def test_a_row_that_is_not_finite_stops_no_command_and_is_named(folder, capsys, command, values):
    spoil_row(**values)
    assert main(COMMANDS[command].split()) == 0
    warnings = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning: model.ply: ")]
    assert len(warnings) == 1
    assert "1 of 60 rows" in warnings[0]
    assert warnings[0].endswith(": 7")


@pytest.mark.parametrize("command", OF_NUMBERS)
def test_a_model_without_a_finite_row_is_refused_by_every_command(folder, capsys, command):
    model = read_model("model.ply")
    write_model("model.ply", model.with_columns({"y": np.full(COUNT, np.nan)}))
    line = "model.ply: y: expected finite numbers, found infinity or not-a-number in 60 of 60 rows"
    assert refusal(folder, capsys, COMMANDS[command]).startswith(line)


def edit_cameras(edit):
    views = json.loads(Path("cameras.json").read_text())
    edit(views)
    Path("cameras.json").write_text(json.dumps(views))


BAD_CAMERAS = {
    "zero focal length": (
        lambda views: views[3].update(fx=0),
        "[3].fx: expected a positive number up to 1e+18, found 0",
    ),
    "NaN focal length": (
        lambda views: views[3].update(fy=float("nan")),
        "[3].fy: expected a positive number up to 1e+18, found nan",
    ),
    "size in words": (lambda views: views[2].update(width="wide"), "[2].width: expected a whole number of pixels"),
    "huge focal length": (lambda views: views[3].update(fx=1e300), "[3].fx: expected a positive number up to 1e+18"),
    "no position": (
        lambda views: views[2].pop("position"),
        "[2].position: expected numbers [3] within ±1e+18, found nothing",
    ),
    "no rotation": (lambda views: views[0].update(rotation=[[1, 0, 0]] * 3), "[0].rotation: expected a rotation"),
    "a name twice": (lambda views: views.append(views[0]), "view names: expected each name once, found 'view_0'"),
    "no view": (lambda views: views.clear(), "views: expected at least one, found none"),
}


@pytest.mark.parametrize("command", OF_CAMERAS)
@pytest.mark.parametrize(("edit", "line"), BAD_CAMERAS.values(), ids=BAD_CAMERAS)
def test_bad_cameras_are_refused_by_every_command(folder, capsys, command, edit, line):
    edit_cameras(edit)
    assert refusal(folder, capsys, COMMANDS[command]).startswith(f"cameras.json: {line}")


@pytest.mark.parametrize("command", OF_CAMERAS)
@pytest.mark.parametrize("content", [b"", b'[{"id"', b"3", bytes(range(256))], ids=["empty", "cut", "number", "binary"])
def test_a_file_that_holds_no_cameras_is_refused_by_every_command(folder, capsys, command, content):
    Path("cameras.json").write_bytes(content)
    assert refusal(folder, capsys, COMMANDS[command]).startswith("cameras.json: file: expected ")


NOT_NEGATIVE = "expected finite numbers of at least 0"


@pytest.mark.parametrize("command", OF_WEIGHTS)
@pytest.mark.parametrize(
    ("weights", "line"),
    [
        (np.ones(3, np.float32), "expected float32 [60], found float32 [3]"),
        (np.ones(COUNT), "expected float32 [60], found float64 [60]"),
        (np.full(COUNT, np.nan, np.float32), f"{NOT_NEGATIVE}, found others in 60 of 60 places, first nan in row 0"),
        (np.float32([*[0] * 7, -3, *[1] * 52]), f"{NOT_NEGATIVE}, found others in 1 of 60 places, first -3.0 in row 7"),
    ],
    ids=["of another model", "wrong type", "NaN", "negative"],
)
def test_bad_weights_are_refused_by_every_command(folder, capsys, command, weights, line):
    save_array(Path("weights.npy"), weights)
    assert refusal(folder, capsys, COMMANDS[command]) == f"weights.npy: array: {line}\n"


BAD_TRANSFORMS = {
    "singular": np.diag([1.0, 1.0, 0.0, 1.0]),
    "scaled": np.diag([2.0, 2.0, 2.0, 1.0]),
    "mirrored": np.diag([1.0, 1.0, -1.0, 1.0]),
    "projective": np.eye(4)[[0, 1, 2, 2]],
    "too far": np.eye(4) + 1e300 * np.eye(4, k=3),
}


@pytest.mark.parametrize("transform", BAD_TRANSFORMS.values(), ids=BAD_TRANSFORMS)
def test_a_transform_that_is_not_rigid_is_refused(folder, capsys, transform):
    save_array(Path("transform.npy"), transform)
    error = refusal(folder, capsys, COMMANDS["render"] + " --transform transform.npy")
    assert error.startswith("transform.npy: array: expected ")


BAD_IMAGES = {
    "missing": (lambda: Path("a/2.png").unlink(), "a/2.png: file: expected a counterpart of b/2.png, found nothing"),
    "cut": (lambda: cut("b/2.png", 900), "b/2.png: file: expected an image"),
    "no image": (lambda: Path("b/2.png").write_text("no image"), "b/2.png: file: expected an image"),
    "other size": (lambda: write_image("b/2.png", np.zeros((9, 9, 3))), "b/2.png: size: expected 30x20, as a/2.png"),
    "JPEG": (lambda: Path("b/2.png").rename("b/2.jpg"), "b/2.jpg: suffix: expected only PNG files (.png)"),
    "capitals": (lambda: Path("b/2.png").rename("b/2.PNG"), "b/2.PNG: suffix: expected only PNG files (.png)"),
    "no folder": (lambda: Path("b").rename("c"), "b: folder: expected PNG files, found no such folder"),
}


@pytest.mark.parametrize(("spoil", "line"), BAD_IMAGES.values(), ids=BAD_IMAGES)
def test_bad_images_are_refused(folder, capsys, spoil, line):
    spoil()
    assert refusal(folder, capsys, COMMANDS["metrics"]).startswith(line)


def test_a_folder_that_is_called_like_an_argument_is_named_itself(folder, capsys):
    Path("images").mkdir()
    assert refusal(folder, capsys, "metrics a images --out out.csv").startswith("images: folder: expected PNG files")


BAD_OPTIONS = {
    "cameras --resolution half": "resolution: value: expected native, photographs, 1/N or Wpx",
    "attack --set tau=x": "attack plain_weight: tau: expected a number above 0, at most 1000000, found 'x'",
    "attack --set size=1": "attack plain_weight: size: expected one of tau, found an unknown key",
}


@pytest.mark.parametrize(("options", "line"), BAD_OPTIONS.items(), ids=BAD_OPTIONS)
def test_options_out_of_range_are_refused(folder, capsys, options, line):
    command, _, option = options.partition(" --")
    assert refusal(folder, capsys, f"{COMMANDS[command]} --{option}").startswith(line)


@pytest.mark.parametrize("command", sorted({*COMMANDS} - {"info"}))
def test_an_output_that_cannot_be_written_is_named(folder, capsys, command):
    Path("file").touch()
    words = [f"file/{word}" if word.startswith("out") else word for word in COMMANDS[command].split()]
    before = sorted(folder.rglob("*"))
    assert main(words) == 2
    error = capsys.readouterr().err.splitlines()[-1]  # others tell of work that was done before
    assert error.startswith(f"gspure {words[0]}: file"), error
    assert sorted(folder.rglob("*")) == before


def test_a_folder_without_permission_is_named_and_not_a_temporary_file(folder, capsys, monkeypatch):
    def mkdir(path, *_, **__):
        if path.name.startswith("."):
            raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "mkdir", mkdir)
    assert refusal(folder, capsys, COMMANDS["purify"]) == "out: Permission denied\n"


@pytest.mark.parametrize("command", ["purify", "render", "contributions"])
def test_a_missing_device_is_refused(folder, capsys, monkeypatch, command):
    monkeypatch.setenv("GSPURE_DEVICE", "nope")
    error = refusal(folder, capsys, COMMANDS[command])
    assert error.startswith("OpenCL: device: expected one that matches 'nope', found ")
    assert refusal(folder, capsys, COMMANDS[command] + " --device 99").startswith(
        "OpenCL: device: expected one that matches '99'"
    )


def python(folder, *arguments, **environment):
    """Run a module in a process of its own, as a user would."""
    return subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_machine_without_devices_is_told_the_remedy(folder):
    before = sorted(folder.rglob("*"))
    done = python(folder, "gspure", *COMMANDS["purify"].split(), OCL_ICD_VENDORS="/nonexistent")
    assert done.returncode == 2
    assert done.stderr.startswith("gspure purify: OpenCL: device: expected ")
    assert "found no device (`make opencl`" in done.stderr
    assert done.stderr.count("\n") == 1
    assert sorted(folder.rglob("*")) == before


@pytest.mark.workflow
@pytest.mark.parametrize(
    ("config", "line"),
    [
        (
            "assets: {m: {model: model.ply, cameras: orbit}}\ntau: 3\n",
            "mine.yaml: tau: expected one of .*, found an unknown key",
        ),
        (
            "assets: {m: {model: no.ply, cameras: orbit}}\n",
            "mine.yaml: assets.m.model: expected an existing file or folder, found no.ply",
        ),
        ("assets: {m: {train: cut}}\n", r"cut/cameras.json: \[0\].width: expected a whole number .*, found nothing"),
    ],
    ids=["unknown key", "missing model", "photographs without cameras"],
)
def test_a_wrong_configuration_is_refused_by_snakemake_in_one_line(folder, config, line):
    Path("cut").mkdir()
    Path("cut/cameras.json").write_text('[{"id": 0}]')
    Path("mine.yaml").write_text(config)
    arguments = ("--snakefile", str(ROOT / "Snakefile"), "--configfile", "mine.yaml", "--cores", "1")
    done = python(folder, "snakemake", *arguments)
    assert done.returncode == 2
    (error,) = [text for text in done.stderr.splitlines() if not text.startswith("Using workflow specific profile")]
    assert re.fullmatch(f"gspure: {line}", error)
    assert not Path("results").exists()


def test_a_path_cannot_send_escape_sequences_to_the_terminal(folder, capsys):
    Path("cameras.json").rename("\x1b[2J\n.json")
    assert main(["cameras", "\x1b[2J\n.json/x", "--out", "out.json"]) == 2
    assert main(["cameras", "cameras.json", "--out", "\x1b[2J\n.json/out.json"]) == 2
    lines = capsys.readouterr().err.split("\n")
    assert len(lines) == 3
    assert all(line.isprintable() for line in lines)


def name_origin(artifact):
    """Write the record of an artifact that was made from the model."""
    geometry = read_model("model.ply").geometry_digest()
    write_record(Path(artifact), inputs={"model": Path("model.ply")}, settings={}, geometry=geometry)


def test_weights_fit_their_model_after_it_was_recoloured(folder, capsys):
    measured = "--model model.ply --cameras cameras.json --split all --index 1.tsv --stages stages"
    for command in (f"contributions {measured}", "weights --index 1.tsv --model model.ply --out weights.npy"):
        assert main(command.split()) == 0
    spoil_row(f_dc_0=0.25)
    for command in ("features", "attack"):
        assert main(COMMANDS[command].split()) == 0
    spoil_row(opacity=0.25)
    capsys.readouterr()
    assert "not of the same model" in refusal(folder, capsys, COMMANDS["attack"])


MASKED = "attack gspure --model model.ply --prune-mask mask.npy --out out.ply"
PRUNED = "prune --clusters clusters.npz --weights weights.npy --out mask.npy"


def test_a_prune_mask_of_another_model_is_refused_by_the_origin_of_its_weights(folder, capsys):
    name_origin("weights.npy")
    write_record(Path("clusters.npz"), inputs={"weights": Path("weights.npy")}, settings={})
    assert main(PRUNED.split()) == 0
    spoil_row(x=9.0)
    assert refusal(folder, capsys, MASKED).startswith("mask.npy: model: ")
    assert refusal(folder, capsys, f"{PRUNED} --model model.ply").startswith("clusters.npz: model: ")


def cluster(weights, tree="tree.npy", clusters="clusters.npz"):
    for command in (
        f"features --model model.ply --weights {weights} --out features.npy",
        f"tree --features features.npy --out {tree}",
        f"cluster --tree {tree} --min-cluster-size 5 --out {clusters}",
    ):
        assert main(command.split()) == 0


def test_clusters_of_other_weights_of_the_same_model_are_refused(folder, capsys):
    measured = "--model model.ply --cameras cameras.json --split all --index 1.tsv --stages stages"
    averaged = "weights --index 1.tsv --model model.ply"
    for command in (
        f"contributions {measured}",
        f"{averaged} --out highest.npy --reduction max",
        f"{averaged} --out weights.npy",
        "attack unattacked --model model.ply --out out.ply",
    ):
        assert main(command.split()) == 0
    cluster("highest.npy")
    assert main(PRUNED.replace("weights.npy", "highest.npy").split()) == 0
    matched = "attack lowest_weight_matched --model model.ply --prune-mask mask.npy --weights {} --out matched.ply"
    scaled = "attack gspure_scaled --model model.ply --labels clusters.npz --weights {} --out scaled.ply"
    for command in (
        PRUNED.replace("weights.npy", "{}"),
        COMMANDS["figures"].replace("weights.npy", "{}"),
        matched,
        scaled,
    ):
        capsys.readouterr()
        line = refusal(folder, capsys, command.format("weights.npy"))
        assert re.match(r"(weights.npy|mask.npy|clusters.npz): weights: expected \w+, as in ", line)
        assert main(command.format("highest.npy").split()) == 0
    cluster("weights.npy", clusters="others.npz")
    Path("weights.npy.json").unlink()
    assert main(f"{PRUNED}".replace("mask.npy", "out.npy").split()) == 0


def test_an_index_that_is_named_twice_is_refused_for_that_reason(folder, capsys):
    measured = "--model model.ply --cameras cameras.json --split all --index 1.tsv --stages stages"
    assert main(f"contributions {measured}".split()) == 0
    capsys.readouterr()
    line = refusal(folder, capsys, "weights --index 1.tsv 1.tsv --model model.ply --out out.npy")
    assert "expected each view in one index only" in line


def test_pruning_factors_that_remove_every_row_are_refused(folder, capsys):
    command = f"{COMMANDS['purify']} --tau-n 1e-9 --tau-c 1e-9"
    assert main(command.split()) == 2
    assert "not applicable: none of 60 rows would remain" in capsys.readouterr().err
    assert not Path("out").exists()


def test_results_of_two_runs_of_purify_are_refused_together(folder, capsys):
    for out, energy in (("rays", "ray"), ("splats", "ewa")):
        assert main(f"purify model.ply --cameras cameras.json --out {out} --energy {energy}".split()) == 0
    capsys.readouterr()
    command = "attack lowest_weight_matched --model model.ply --prune-mask rays/prune_mask.npy --out out.ply --weights "
    assert "rays/prune_mask.npy" in refusal(folder, capsys, f"{command}splats/weights.npy")
    assert main(f"{command}rays/weights.npy".split()) == 0


def test_an_array_of_another_kind_is_refused_though_type_and_shape_fit(folder, capsys):
    cameras = "--cameras cameras.json"
    assert main(f"opacities --model model.ply {cameras} --out opacities.npy".split()) == 0
    assert main(f"surface --model model.ply {cameras} --method depth --out surface.npy".split()) == 0
    assert (
        main(["attack", "random_pruning", "--model", "model.ply", "--out", "random.ply", "--removed", "out.npy"]) == 0
    )
    clustered = COMMANDS["figures"].replace("weights.npy", "{}")
    capsys.readouterr()
    for command, wrong, expected in (
        (COMMANDS["attack"].replace("weights.npy", "{}"), "opacities.npy", "weights"),
        (COMMANDS["features"].replace("weights.npy", "{}"), "surface.npy", "weights"),
        (PRUNED.replace("weights.npy", "{}"), "surface.npy", "weights or opacities"),
        (f"{COMMANDS['features']} --opacities {{}}", "surface.npy", "opacities"),
        (clustered, "opacities.npy", "weights"),
        (MASKED.replace("mask.npy", "{}"), "out.npy", "prune_mask"),
    ):
        assert f"{wrong}: content: expected {expected}, found" in refusal(folder, capsys, command.format(wrong))
    assert main(PRUNED.replace("weights.npy", "opacities.npy").split()) == 0


def test_results_of_purify_are_refused_for_another_model(folder, capsys):
    Path("run/point_cloud/iteration_7").mkdir(parents=True)
    Path("run/cfg_args").write_text("Namespace()")
    Path("model.ply").rename("run/point_cloud/iteration_7/point_cloud.ply")
    Path("weights.npy").unlink()
    assert main(["purify", "run", "--cameras", "cameras.json", "--out", "."]) == 0
    capsys.readouterr()
    Path("prune_mask.npy").rename("mask.npy")
    Path("prune_mask.npy.json").rename("mask.npy.json")
    write_model("model.ply", read_model("run"))
    assert main(MASKED.split()) == 0
    capsys.readouterr()
    spoil_row(x=9.0)
    for command in (MASKED, COMMANDS["attack"]):
        assert "not of the same model" in refusal(folder, capsys, command)


OVERWRITING = (
    "prune --clusters clusters.npz --weights weights.npy --out weights.npy",
    "contest --table a.csv --out out.csv --survival ./out.csv --matched m.csv --markdown t.md",
    "attack unattacked --model model.ply --out ./model.ply",
    "cameras cameras.json --resolution 1/2 --out cameras.json",
    "figures panels --column left=a --column right=b --out b/../a/1.png",
    "render a --cameras cameras.json --out a",
)


@pytest.mark.parametrize("command", OVERWRITING)
def test_no_command_overwrites_an_input_or_another_output(folder, capsys, command):
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert "expected a separate file" in refusal(folder, capsys, command)
    assert all(path.read_bytes() == content for path, content in before.items())


def test_a_result_in_an_input_folder_is_replaced_by_the_next_run(folder):
    for _ in range(2):
        assert main(["metrics", "a", "b", "--out", "b/metrics.csv"]) == 0


class Closed(io.StringIO):
    """Standard output whose reader (`| head`) has gone."""

    def write(self, text):
        raise BrokenPipeError

    def fileno(self):
        return os.open(os.devnull, os.O_WRONLY)


PRINTING = {
    "prune": "prune --clusters clusters.npz --weights weights.npy --out out.npy --diagnosis out.json",
    "metrics": "metrics a b --out out.csv",
    "paper-check": "paper-check --out out.csv",
    "attack": "attack random_pruning --model model.ply --damage 1 --cameras cameras.json --out out.ply",
    "purify": "purify model.ply --cameras cameras.json --out dir",
    "figures": COMMANDS["figures"],
}
WRITTEN = {"attack": "out.ply", "prune": "out.npy", "purify": "dir/figures/kept.png", "figures": "out/weights.png.json"}


@pytest.mark.parametrize("command", PRINTING)
def test_everything_is_written_before_anything_is_printed(folder, monkeypatch, command):
    monkeypatch.setattr(sys, "stdout", Closed())
    assert main(PRINTING[command].split()) == 1
    assert Path(WRITTEN.get(command, "out.csv")).is_file()
