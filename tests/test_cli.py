"""The command line: help, examples, one-line errors."""

from __future__ import annotations

import argparse
import re
import shlex
import signal
import subprocess
import sys
import warnings
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from gspure import cli
from gspure.cameras import read_cameras, split, write_cameras
from gspure.cli import COMMANDS, JOBS, USER_COMMANDS, main
from gspure.cli.contributions import _part
from gspure.cli.parser import Output
from gspure.images import read_image, write_image
from gspure.method.contributions import read_index, read_stage
from gspure.model import read_model, write_model
from gspure.renderer import Renderer
from tests.models import blobs, camera

HEAVY = ("numpy", "scipy", "pyopencl", "hdbscan", "pyvista", "matplotlib", "plyfile", "rich", "jinja2", "PIL")


def examples(command):
    """The words of a command's examples, as a shell splits them."""
    module = import_module(f"gspure.cli.{command.replace('-', '_')}")
    lines = module.EXAMPLES.replace("\\\n", " ").splitlines()
    return [shlex.split(line, comments=True) for line in lines if line.startswith("  gspure ")]


@pytest.fixture
def asset(tmp_path):
    write_model(tmp_path / "model.ply", blobs(30))
    write_cameras(tmp_path / "cameras.json", [camera(40, 30, name=f"view_{i}") for i in range(9)])
    return tmp_path


def test_help_imports_nothing_heavy():
    code = (
        f"import sys\nfrom gspure.cli import main\ntry: main(['--help'])\nfinally: print(*sys.modules.keys() & {HEAVY})"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == ""


INTERRUPTED = """
import os, runpy, signal, sys

class Finder:
    interrupting = sys.argv.pop(1)

    def find_spec(self, name, *_):
        if name == self.interrupting:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Finder())
runpy.run_module("gspure", run_name="__main__", alter_sys=True)
"""


@pytest.mark.parametrize("module", ["gspure.cli", "argparse", "gspure.cli.info", "gspure.model", "numpy", "datetime"])
def test_an_interruption_of_any_import_ends_in_one_line(asset, module):
    """Of datetime, too: numpy replaces an interruption of that import by an error."""
    command = [sys.executable, "-c", INTERRUPTED, module, "info", str(asset / "model.ply")]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (130, "")
    assert re.fullmatch(r"gspure( info)?: interrupted\n", run.stderr)


def test_a_terminated_command_leaves_nothing_half_done(asset):
    """By `timeout`, Slurm or `docker stop`."""
    code = "import os, signal, sys, gspure.images; from gspure.__main__ import main\n"
    code += "gspure.images.write_image = lambda *_: os.kill(os.getpid(), signal.SIGTERM); sys.exit(main())"
    words = ["render", "model.ply", "--cameras", "cameras.json", "--out", "out"]
    run = subprocess.run([sys.executable, "-c", code, *words], cwd=asset, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr.splitlines()[-1]) == (143, "gspure render: interrupted")
    assert not (asset / "out").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_progress_that_cannot_be_written_is_left_out(asset):
    files = [str(asset / "model.ply"), "--cameras", str(asset / "cameras.json"), "--out", str(asset / "out")]
    with Path("/dev/full").open("w") as full:
        for words, status in (([], 0), (["--split", "test", "--scheme", "none"], 2)):
            command = [sys.executable, "-m", "gspure", "render", *files, *words]
            assert subprocess.run(command, stderr=full, check=False).returncode == status
    assert list((asset / "out").glob("*.png"))


def test_a_signal_that_is_ignored_stays_ignored(monkeypatch):
    from gspure import __main__ as process

    dispositions = {signal.SIGINT: signal.SIG_IGN, signal.SIGTERM: signal.SIG_IGN}
    monkeypatch.setattr(signal, "getsignal", dispositions.__getitem__)
    monkeypatch.setattr(signal, "signal", dispositions.__setitem__)
    monkeypatch.setattr(sys, "argv", ["gspure", "info", "no.ply"])
    assert process.main() == 2
    assert {*dispositions.values()} == {signal.SIG_IGN}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
@pytest.mark.parametrize("redirection", [">/dev/full", "2>&-"])
def test_output_that_cannot_be_written_gives_one_line_or_is_left_out(asset, redirection):
    command = shlex.join([sys.executable, "-m", "gspure", "info", str(asset / "model.ply")])
    run = subprocess.run(f"{command} {redirection}", shell=True, capture_output=True, text=True, check=False)  # noqa: S602
    if redirection == "2>&-":
        assert (run.returncode, "30" in run.stdout) == (0, True)
    else:
        assert (run.returncode, run.stderr) == (2, "gspure info: standard output: No space left on device\n")


def test_help_lists_main_commands_before_stages(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    listed = re.findall(r"^  ([a-z-]+)  +\S", capsys.readouterr().out, flags=re.MULTILINE)
    assert [name for name in listed if name in COMMANDS] == [*USER_COMMANDS, *JOBS]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_shows_examples_that_it_accepts(command):
    assert examples(command)
    for example in examples(command):
        _, named, *arguments = example
        assert named == command
        cli.parser_of(command).parse_args(arguments)


def test_examples_of_the_stages_pasted_one_after_the_other_purify_a_model(asset, monkeypatch):
    monkeypatch.chdir(asset)
    write_model("point_cloud.ply", blobs(300))
    for stage in ("contributions", "weights", "opacities", "features", "tree", "cluster", "prune", "attack", "figures"):
        for _, *arguments in examples(stage):
            if not {"panels", "--table"} & {*arguments}:
                assert main(arguments) == 0
    pruned = np.load("prune_mask.npy")
    assert read_model("purified.ply").table.tobytes() == blobs(300).table[~pruned].tobytes()
    assert Path("figures/kept.png").exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["pur"], ["purify"]),
        (["purify", "--ca"], ["--cameras"]),
        (["purify", "mod"], ["model.ply"]),
        (["render", "x.ply", "--cameras", "mod"], ["model.ply"]),
        (["render", "--split", "te"], ["test"]),
        (["figures", "pan"], ["panels"]),
    ],
)
def test_a_shell_completes_commands_options_and_files(tmp_path, capsys, words, expected):
    pytest.importorskip("shtab", reason="gspure[completion] is not installed")
    assert main(["completion", "bash"]) == 0
    (tmp_path / "gspure.bash").write_text(capsys.readouterr().out)
    (tmp_path / "model.ply").touch()
    line = shlex.join(["gspure", *words])
    script = f"source gspure.bash; COMP_WORDS=({line}); COMP_CWORD={len(words)}; _shtab_gspure; echo ${{COMPREPLY[@]}}"
    done = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.split() == expected


def test_warnings_of_libraries_take_one_line_each_without_a_place_in_their_code(monkeypatch, capsys):
    from gspure.cli import doctor

    def overflow(_args: argparse.Namespace) -> None:
        for number in (100, 200):
            np.exp(np.float32(number))
        warnings.warn("slow\nor not", UserWarning, stacklevel=1)

    monkeypatch.setattr(doctor, "run", overflow)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert main(["doctor"]) == 0
    lines = ["warning: results may be wrong: overflow encountered in exp", r"warning: slow\nor not"]
    assert capsys.readouterr().err.splitlines() == lines


def test_without_its_package_completion_names_what_to_install(capsys, monkeypatch):
    monkeypatch.setattr("gspure.plugins.find_spec", lambda name: None)
    assert main(["completion", "zsh"]) == 2
    assert "pip install gspure[completion]" in capsys.readouterr().err


@pytest.mark.parametrize("argv", [["bogus"], ["--bogus"], ["render"], ["figures", "b\nd"]])
def test_a_wrong_command_line_ends_in_one_line_with_status_2(argv, capsys):
    with pytest.raises(SystemExit) as leaving:
        main(argv)
    assert leaving.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("gspure")
    assert line.endswith("--help`")


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("purfy model.ply", "purify"),
        ("paper_check", "paper-check"),
        ("render m.ply --camera-s c.json --out x", "--cameras"),
        ("render m.ply --cameras c.json --otu=x", "--out"),
        ("figures outcomes --tabel t.csv --name a/b --out x.png", "--table"),
        ("--verison", "--version"),
    ],
)
def test_a_typo_gets_a_suggestion(line, meant, capsys):
    with pytest.raises(SystemExit) as leaving:
        main(line.split())
    assert leaving.value.code == 2
    assert f"did you mean {meant}?" in capsys.readouterr().err


@pytest.mark.parametrize("line", ["xyzzy", "render m.ply --xyzzy", "figures outcome --table t.csv", "render m.ply"])
def test_a_name_without_a_similar_one_gets_no_suggestion(line, capsys):
    with pytest.raises(SystemExit):
        main(line.split())
    assert not re.search("did you mean|no option --table", capsys.readouterr().err)


def test_quiet_leaves_out_progress_but_no_warning(asset, capsys):
    rows = read_model(asset / "model.ply")
    columns = {"x": np.append(rows.table["x"][:-1], np.float32(np.nan))}
    write_model(asset / "model.ply", rows.with_columns(columns))
    command = ["render", str(asset / "model.ply"), "--cameras", str(asset / "cameras.json"), "--split", "test"]
    assert main([*command, "--out", str(asset / "quiet"), "--quiet"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("warning: ")
    assert main([*command, "--out", str(asset / "loud")]) == 0
    assert len(capsys.readouterr().err.splitlines()) > 1


@pytest.mark.parametrize(
    "argv",
    [
        ["render", "m.ply", "--cameras", "c.json", "--out", ""],
        ["render", "", "--cameras", "c.json", "--out", "x"],
        ["purify", "m.ply", "--cameras", "", "--out", "x"],
        ["figures", "outcomes", "--table", "t.csv", "--name", "a/b", "--out="],
        ["report", "--table", "t.csv", "--figures", "", "--out", "x"],
    ],
    ids=lambda argv: argv[0],
)
def test_an_empty_path_is_refused(argv, capsys):
    with pytest.raises(SystemExit) as leaving:
        main(argv)
    assert leaving.value.code == 2
    assert "found an empty text" in capsys.readouterr().err


def parsers() -> dict[str, argparse.ArgumentParser]:
    """Return the parsers of all commands, and of the kinds of figures instead of that of `gspure figures`."""
    known = {}
    for command in COMMANDS:
        parser = cli.parser_of(command)
        kinds = [action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
        known |= {f"{command} {name}": kind for name, kind in kinds[0].items()} if kinds else {command: parser}
    return known


@pytest.mark.parametrize("command", parsers())
def test_every_output_has_the_suffix_of_its_format(command):
    parser = parsers()[command]
    for action in parser._actions:
        if action.type is Output and action.metavar != "DIR":
            namespace = argparse.Namespace()
            for suffix in (f".{kind.lower()}" for kind in action.metavar.split("|")):
                action(parser, namespace, Output(f"folder/name{suffix}"))
            for name in ("name", "name.txt", "name.jpg", "name.svg.bak", f"name{suffix}x"):
                with pytest.raises(argparse.ArgumentError, match=f"expected a name that ends with .*found '{name}'"):
                    action(parser, namespace, Output(name))


def test_bad_input_is_reported_in_one_line_with_status_2(asset, capsys):
    status = main(["render", "missing.ply", "--cameras", str(asset / "cameras.json"), "--out", str(asset / "out")])
    error = capsys.readouterr().err
    assert status == 2
    assert re.fullmatch(r"gspure render: missing\.ply: .*\n", error)
    assert not (asset / "out").exists()


def test_a_folder_that_cannot_be_created_is_reported_in_one_line(asset, capsys):
    command = ["contributions", "--model", str(asset / "model.ply"), "--cameras", str(asset / "cameras.json")]
    status = main([*command, "--stages", str(asset / "stages"), "--index", str(asset / "model.ply" / "1.tsv")])
    assert status == 2
    assert re.search(r"^gspure contributions: .*model\.ply.*: .+\n\Z", capsys.readouterr().err, flags=re.MULTILINE)


def test_a_bug_keeps_its_traceback(asset, monkeypatch):
    monkeypatch.setattr("gspure.cli.render.read_views", lambda args: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        main(["render", "model.ply", "--cameras", "cameras.json", "--out", "out"])


def test_a_command_without_memory_ends_in_one_line(capsys, monkeypatch):
    monkeypatch.setattr("gspure.cli.render.read_views", lambda args: np.empty(1 << 58))
    status = main(["render", "model.ply", "--cameras", "cameras.json", "--out", "out"])
    assert status == 2
    assert re.fullmatch(r"gspure render: .*memory.*\n", capsys.readouterr().err)


def test_an_empty_split_is_refused(tmp_path, capsys):
    write_cameras(tmp_path / "cameras.json", [camera()])
    arguments = ["--cameras", str(tmp_path / "cameras.json"), "--split", "train", "--out", "out"]
    assert main(["render", "model.ply", *arguments]) == 2
    assert "at least one train view, found none" in capsys.readouterr().err


def test_renders_of_views_that_share_only_their_names_are_not_compared(asset, capsys, monkeypatch):
    monkeypatch.chdir(asset)
    write_model(Path("larger.ply"), blobs(40))
    turn = np.array([[0.0, -1, 0, 3], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    np.save("turn.npy", turn)
    for model, cameras, out in (
        ("model", "orbit", "orbit"),
        ("larger", "orbit", "other"),
        ("larger", "orbit/cameras.json", "same"),
        ("model", "orbit/cameras.json --transform turn.npy", "moved"),
    ):
        assert main(["render", f"{model}.ply", "--cameras", *cameras.split(), "--out", out]) == 0
    for other, expected in (("other", 2), ("same", 0), ("moved", 0)):
        panels = ["figures", "panels", "--column", "a=orbit", "--column", f"b={other}", "--out", "panels.png"]
        for command in (["metrics", "orbit", other, "--out", "metrics.csv"], panels):
            capsys.readouterr()
            assert main(command) == expected
            assert ("expected the camera of orbit" in capsys.readouterr().err) == bool(expected)
    assert main(["metrics", "orbit", "other", "--out", "other.csv"]) == 2
    assert not Path("other.csv").exists()


def test_renders_on_other_backgrounds_or_with_other_energies_are_not_compared(asset, capsys, monkeypatch):
    monkeypatch.chdir(asset)
    write_model(Path("grey.ply"), read_model("model.ply").with_background((1 / 3, 1, 1)))
    for model, options, out in (
        ("grey", "", "grey"),
        ("model", "--background 0.33333 1 1", "explicit"),
        ("model", "", "black"),
        ("grey", "--energy ray", "ray"),
    ):
        assert main(["render", f"{model}.ply", "--cameras", "cameras.json", "--out", out, *options.split()]) == 0
    for other, expected, field in (
        ("explicit", 0, ""),
        ("black", 2, "black: background: "),
        ("ray", 2, "ray: energy: "),
    ):
        panels = ["figures", "panels", "--column", "a=grey", "--column", f"b={other}", "--out", "panels.png"]
        for command in (["metrics", "grey", other], panels):
            capsys.readouterr()
            assert main(command) == expected
            assert field in capsys.readouterr().err


def test_render_names_images_after_views(asset):
    out = asset / "renders"
    arguments = ["--cameras", str(asset / "cameras.json"), "--out", str(out), "--split", "test", "--npy"]
    assert main(["render", str(asset / "model.ply"), *arguments, "--background", "0", "0.5", "1"]) == 0
    held_out = split(read_cameras(asset / "cameras.json"))[1]
    names = [view.name for view in held_out]
    images = [f"{name}.{kind}" for name in names for kind in ("npy", "png")]
    records = ["rendered.json", *(f"{name}.npy.json" for name in names)]
    assert sorted(path.name for path in out.iterdir()) == sorted([*records, *images])
    floats = np.load(out / f"{names[0]}.npy")
    assert floats.dtype == np.float32
    np.testing.assert_array_equal(floats, Renderer(blobs(30)).image(held_out[0], background=(0, 0.5, 1)))
    np.testing.assert_allclose(read_image(out / f"{names[0]}.png"), np.clip(floats, 0, 1), atol=0.5 / 255 + 1e-6)


CAMERAS = {
    "render": "--out out",
    "contributions": "--stages stages --index out.tsv",
    "opacities": "--out out.npy",
    "surface": "--out out.npy --method depth",
    "attack random_pruning": "--damage 1 --out out.ply",
}


@pytest.mark.parametrize("command", CAMERAS)
def test_generated_views_take_the_place_of_a_camera_file(asset, monkeypatch, command):
    monkeypatch.chdir(asset)
    viewed = []
    monkeypatch.setattr("gspure.cameras.orbit._looking_at", lambda *at: viewed.append(at[1][2]) or np.eye(4))
    name, *arguments = f"{command} {CAMERAS[command]}".split()
    model = ["model.ply"] if name == "render" else ["--model", "model.ply"]
    arguments = [name, *arguments[:1], *model, *arguments[1:]] if name == "attack" else [name, *model, *arguments]
    assert main([*arguments, "--cameras", "orbit", "--up", "0", "0", "1"]) == 0
    assert viewed
    assert all(up.tolist() == [0, 0, 1] for up in viewed)
    assert main([*arguments, "--cameras", "cameras.json", "--up", "0", "0", "1"]) == 2


def test_views_around_a_moved_model_are_not_moved_again(asset, capsys):
    np.save(asset / "moved.npy", np.eye(4))
    command = ["render", str(asset / "model.ply"), "--out", str(asset / "out"), "--transform", str(asset / "moved.npy")]
    assert main([*command, "--cameras", "orbit"]) == 2
    assert "moved.npy: --transform: expected cameras" in capsys.readouterr().err
    assert main([*command, "--cameras", str(asset / "cameras.json"), "--split", "test"]) == 0


def test_generated_views_are_written_beside_their_renders(asset):
    renders = asset / "renders"
    assert main(["render", str(asset / "model.ply"), "--cameras", "orbit", "--out", str(renders)]) == 0
    names = {view.name for view in read_cameras(renders / "cameras.json")}
    assert names == {path.stem for path in renders.glob("*.png")}


def test_arrays_of_an_earlier_render_are_removed(asset):
    command = ["render", str(asset / "model.ply"), "--cameras", str(asset / "cameras.json")]
    command += ["--out", str(asset / "renders"), "--split", "test"]
    assert main([*command, "--npy"]) == 0
    np.save(asset / "renders" / "kept.npy", 0)  # of no view
    assert main(command) == 0
    assert [path.name for path in (asset / "renders").glob("*.npy")] == ["kept.npy"]


def test_a_folder_with_renders_of_other_views_is_refused(asset, capsys):
    command = ["render", str(asset / "model.ply"), "--cameras", str(asset / "cameras.json"), "--out"]
    assert main([*command, str(asset / "renders"), "--split", "test"]) == 0
    assert main([*command, str(asset / "renders")]) == 0  # more views, all of them rendered again
    before = {path: path.read_bytes() for path in (asset / "renders").iterdir()}
    capsys.readouterr()
    assert main([*command, str(asset / "renders"), "--split", "test"]) == 2
    assert "renders: images: expected none of other views, found 7: view_" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in (asset / "renders").iterdir()} == before


def test_metrics_refuses_a_folder_that_lacks_one_of_its_renders(asset, capsys):
    renders = str(asset / "renders")
    assert main(["render", str(asset / "model.ply"), "--cameras", str(asset / "cameras.json"), "--out", renders]) == 0
    assert main(["metrics", renders, renders]) == 0
    (asset / "renders" / "view_3.png").unlink()
    capsys.readouterr()
    assert main(["metrics", renders, renders]) == 2
    assert "view_3.png" in capsys.readouterr().err


def test_an_interrupted_render_leaves_no_mixture_of_two_models(asset, monkeypatch):
    command = ["render", str(asset / "model.ply"), "--cameras", str(asset / "cameras.json")]
    assert main([*command, "--out", str(asset / "renders")]) == 0
    before = {path: path.read_bytes() for path in (asset / "renders").iterdir()}
    write_model(asset / "model.ply", blobs(40))
    images = []

    def interrupted(path, image):
        if images:
            raise KeyboardInterrupt
        images.append(path)
        write_image(path, image)

    monkeypatch.setattr("gspure.images.write_image", interrupted)
    assert main([*command, "--out", str(asset / "renders")]) == 130
    assert {path: path.read_bytes() for path in (asset / "renders").iterdir()} == before


def test_contributions_of_all_parts_are_those_of_the_renderer(asset):
    command = ["contributions", "--model", str(asset / "model.ply"), "--cameras", str(asset / "cameras.json")]
    for part in (1, 2):
        stages = ["--stages", str(asset / "stages"), "--index", str(asset / f"{part}.tsv")]
        assert main([*command, *stages, "--part", f"{part}/2"]) == 0
    train = split(read_cameras(asset / "cameras.json"))[0]
    listed = read_index(asset / "1.tsv", asset / "2.tsv")
    assert [stage.view for stage in listed] == [view.name for view in train]
    renderer = Renderer(blobs(30), energy="ray")
    for stage, view in zip(listed, train, strict=True):
        np.testing.assert_array_equal(read_stage(stage.path), renderer.contributions(view))


@pytest.mark.parametrize(("text", "part"), [("1/1", (1, 1)), ("3/4", (3, 4))])
def test_a_part_is_read(text, part):
    assert _part(text) == part


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "/", "1/0", "-1/2", "a/b", "1/2/3"])
def test_an_invalid_part_is_refused(text, capsys):
    with pytest.raises(SystemExit):
        main(["contributions", "--model", "m", "--cameras", "c", "--stages", "s", "--index", "i.tsv", f"--part={text}"])
    assert "expected I/N with 1 <= I <= N" in capsys.readouterr().err


def test_pruning_stages_deletes_what_no_index_lists_and_says_how_much(asset, capsys):
    index = asset / "results" / "vanilla" / "bot" / "contributions" / "1-of-1.tsv"
    command = ["contributions", "--model", str(asset / "model.ply"), "--cameras", str(asset / "cameras.json")]
    folders = ["--stages", str(asset / "stages"), "--index", str(index)]
    main([*command, *folders, "--energy", "ewa"])
    stale = sum(path.stat().st_size for path in (asset / "stages").iterdir())
    main([*command, *folders, "--energy", "ray"])
    (asset / "stages" / "depths.npy").write_bytes(b"no stage")
    assert main(["stages", "prune", "--stages", str(asset / "stages"), "--results", str(asset / "results")]) == 0
    assert (asset / "stages" / "depths.npy").exists()
    assert f"7 stages deleted, {stale} bytes" in capsys.readouterr().out
    assert all(read_stage(stage.path).size for stage in read_index(index))


def test_pruning_stages_without_any_index_is_refused(tmp_path, capsys):
    assert main(["stages", "prune", "--results", str(tmp_path)]) == 2
    assert "at least one index" in capsys.readouterr().err
