"""The command line: help, refusals in one line, exit statuses, interruptions."""

import argparse
import os
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
from gspure.cameras import write_cameras
from gspure.cli import COMMANDS, main
from gspure.cli.parser import Parser
from gspure.model import read_model, write_model
from gspure.settings import SHARE
from tests.models import blobs, camera

HEAVY = ("numpy", "scipy", "pyopencl", "hdbscan", "pyvista", "matplotlib", "plyfile", "rich", "jinja2", "PIL")


def examples(command):
    """The words of a command's examples, as a shell splits them."""
    module = import_module(f"gspure.cli.{command.replace('-', '_')}")
    lines = module.EXAMPLES.replace("\\\n", " ").splitlines()
    return [shlex.split(line, comments=True) for line in lines if line.startswith("  gspure ")]


@pytest.fixture
def asset(tmp_path, monkeypatch):
    """A folder with a model and its cameras; it is the current one."""
    write_model(tmp_path / "model.ply", blobs(30))
    write_cameras(tmp_path / "cameras.json", [camera(40, 30, name=f"view_{i}") for i in range(9)])
    monkeypatch.chdir(tmp_path)
    return tmp_path


RENDER = ["render", "model.ply", "--cameras", "cameras.json", "--split", "test", "--out", "out"]


def refused(words, capsys):
    """The one line by which a parser refuses a command line."""
    with pytest.raises(SystemExit) as leaving:
        main(words)
    assert leaving.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.parametrize("words", [["--help"], ["render", "--help"], ["train", "--help"]], ids=" ".join)
def test_help_imports_nothing_heavy(words):
    code = f"import sys\nfrom gspure.cli import main\ntry: main({words})\nfinally: print(*sys.modules.keys() & {HEAVY})"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == ""


def test_help_lists_every_command(capsys):
    with pytest.raises(SystemExit) as leaving:
        main(["--help"])
    listed = re.findall(r"^  ([a-z-]+)  +\S", capsys.readouterr().out, flags=re.MULTILINE)
    assert leaving.value.code == 0
    assert [name for name in listed if name in COMMANDS] == [*COMMANDS]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_examples_that_it_accepts(command, capsys):
    with pytest.raises(SystemExit) as leaving:
        main([command, "--help"])
    assert leaving.value.code == 0
    printed = capsys.readouterr().out
    assert COMMANDS[command].split()[0] in printed
    assert examples(command)
    for _, named, *arguments in examples(command):
        assert named == command
        cli.parser_of(command).parse_args(arguments)


@pytest.mark.parametrize("words", [["bogus"], ["--bogus"], ["render"], ["render", "b\nd"]], ids=repr)
def test_a_wrong_command_line_ends_in_one_line_with_status_2(words, capsys):
    line = refused(words, capsys)
    assert line.startswith("gspure")
    assert line.endswith("--help`")


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("purfy model.ply", "purify"),
        ("paper_check", "paper-check"),
        ("render m.ply --camera-s c.json --out x", "--cameras"),
        ("render m.ply --cameras c.json --otu=x", "--out"),
        ("--verison", "--version"),
    ],
)
def test_a_typo_gets_a_suggestion(line, meant, capsys):
    assert f"did you mean {meant}?" in refused(line.split(), capsys)


@pytest.mark.parametrize("line", ["xyzzy", "render m.ply --xyzzy", "render m.ply"])
def test_a_name_without_a_similar_one_gets_no_suggestion(line, capsys):
    assert "did you mean" not in refused(line.split(), capsys)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["render", "m.ply", "--cameras", "c.json", "--out", ""], "found an empty text"),
        (["render", "", "--cameras", "c.json", "--out", "x"], "found an empty text"),
        (["cameras", "c.json", "--out", "cameras.txt"], "--out: expected a name that ends with .json, found"),
        (["attack", "crop", "--model", "m", "--out", "m.obj"], "a name that ends with .ply or .spz, found 'm.obj'"),
        (["attack", "crop", "--model", "m", "--out", "m.ply", "--set", "x"], "--set: expected NAME=VALUE, found 'x'"),
        (["purify", "m", "--cameras", "orbit", "--out", "o", "--tau-c", "0"], "--tau-c: expected a number above 0"),
        (["render", "m", "--cameras", "c", "--out", "o", "--background", "0", "0", "nan"], "from 0 to 1, found 'nan'"),
        (["train", "d", "--out", "o", "--seed=-1"], "--seed: expected a whole number from 0 to 4294967295, found '-1'"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_a_value_that_an_option_does_not_take_is_refused(words, expected, capsys):
    assert expected in refused(words, capsys)


@pytest.mark.parametrize("word", ["-0.1", "1.5", "nan", "inf", "1e400", "", " ", "0x1", "1_0", "½", "1,5", "None"])
def test_numbers_out_of_range_and_other_texts_are_refused(word, capsys):
    parser = Parser(prog="gspure test")
    parser.number("--share", "S", "a share", SHARE)
    assert parser.parse_args(["--share", "0.25"]).share == 0.25
    with pytest.raises(SystemExit):
        parser.parse_args([f"--share={word}"])
    assert "expected a number from 0 to 1, found" in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_number_has_bounds_that_its_help_names_and_its_default_keeps(command):
    for action in cli.parser_of(command)._actions:
        assert action.type not in {int, float}
        limits = getattr(action.type, "args", ())
        if isinstance(action.default, int | float) and not isinstance(action.default, bool):
            assert action.default in limits[0]
            assert str(limits[0]) in action.help


def test_bad_input_is_reported_in_one_line_with_status_2(asset, capsys):
    assert main(["render", "missing.ply", *RENDER[2:]]) == 2
    assert re.fullmatch(r"gspure render: missing\.ply: .*\n", capsys.readouterr().err)
    assert not Path("out").exists()


def test_an_error_about_an_argument_names_its_file(monkeypatch, asset, capsys):
    from gspure.cli import render
    from gspure.errors import InputError

    def refuse(_args: argparse.Namespace) -> None:
        raise InputError("model", "rows", expected="many", found="few")

    monkeypatch.setattr(render, "run", refuse)
    assert main(RENDER) == 2
    assert capsys.readouterr().err == "gspure render: model.ply: rows: expected many, found few\n"


def test_a_path_cannot_send_escape_sequences_to_the_terminal(asset, capsys):
    assert main(["info", "\x1b[2J\n.ply"]) == 2
    (line, rest) = capsys.readouterr().err.split("\n")
    assert line.isprintable()
    assert not rest


def test_a_bug_keeps_its_traceback(asset, monkeypatch):
    monkeypatch.setattr("gspure.cli.options.read_views", lambda args: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        main(RENDER)


def test_a_command_without_memory_ends_in_one_line(asset, capsys, monkeypatch):
    monkeypatch.setattr("gspure.cli.options.read_views", lambda args: np.empty(1 << 58))
    assert main(RENDER) == 2
    assert re.fullmatch(r"gspure render: .*memory.*\n", capsys.readouterr().err)


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


def test_quiet_leaves_out_progress_but_no_warning(asset, capsys):
    rows = read_model("model.ply")
    write_model("model.ply", rows.with_columns({"x": np.append(rows.table["x"][:-1], np.float32(np.nan))}))
    assert main([*RENDER, "--quiet"]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: ")
    assert main(RENDER) == 0
    assert len(capsys.readouterr().err.splitlines()) > 1


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


@pytest.mark.parametrize("module", ["gspure.cli", "gspure.cli.info", "datetime"])
def test_an_interruption_of_any_import_ends_in_one_line(asset, module):
    """Of datetime, too: numpy replaces an interruption of that import by an error."""
    command = [sys.executable, "-c", INTERRUPTED, module, "info", "model.ply"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (130, "")
    assert re.fullmatch(r"gspure( info)?: interrupted\n", run.stderr)


def test_a_terminated_command_leaves_nothing_half_done(asset):
    """By `timeout`, Slurm or `docker stop`."""
    code = "import os, signal, sys, gspure.images; from gspure.__main__ import main\n"
    code += "gspure.images.write_image = lambda *_: os.kill(os.getpid(), signal.SIGTERM); sys.exit(main())"
    run = subprocess.run([sys.executable, "-c", code, *RENDER], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr.splitlines()[-1]) == (143, "gspure render: interrupted")
    assert not [*Path("out").glob("*")]


def test_a_signal_that_is_ignored_stays_ignored(monkeypatch):
    from gspure import __main__ as process

    dispositions = {signal.SIGINT: signal.SIG_IGN, signal.SIGTERM: signal.SIG_IGN}
    monkeypatch.setattr(signal, "getsignal", dispositions.__getitem__)
    monkeypatch.setattr(signal, "signal", dispositions.__setitem__)
    monkeypatch.setattr(sys, "argv", ["gspure", "info", "no.ply"])
    assert process.main() == 2
    assert {*dispositions.values()} == {signal.SIG_IGN}


def test_a_reader_that_has_gone_is_no_error(asset, monkeypatch):
    class Closed(argparse.Namespace):
        def write(self, _text: str) -> int:
            raise BrokenPipeError

        def fileno(self) -> int:
            return os.open(os.devnull, os.O_WRONLY)

    monkeypatch.setattr(sys, "stdout", Closed())
    words = ["attack", "random_pruning", "--model", "model.ply", "--out", "out.ply"]
    assert main(words) == 1
    assert Path("out.ply").is_file(), "everything is written before anything is printed"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
@pytest.mark.parametrize("redirection", [">/dev/full", "2>&-", "2>/dev/full"])
def test_output_that_cannot_be_written_gives_one_line_or_is_left_out(asset, redirection):
    command = f"{shlex.join([sys.executable, '-m', 'gspure', 'info', 'model.ply'])} {redirection}"
    run = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)  # noqa: S602
    if redirection == ">/dev/full":
        assert (run.returncode, run.stderr) == (2, "gspure info: standard output: No space left on device\n")
    else:
        assert (run.returncode, "30" in run.stdout) == (0, True)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["pur"], ["purify"]),
        (["purify", "--ca"], ["--cameras"]),
        (["purify", "mod"], ["model.ply"]),
        (["render", "x.ply", "--cameras", "mod"], ["model.ply"]),
        (["render", "--split", "te"], ["test"]),
    ],
)
def test_a_shell_completes_commands_options_and_files(asset, capsys, words, expected):
    pytest.importorskip("shtab", reason="gspure[completion] is not installed")
    assert main(["completion", "bash"]) == 0
    Path("gspure.bash").write_text(capsys.readouterr().out)
    line = shlex.join(["gspure", *words])
    script = f"source gspure.bash; COMP_WORDS=({line}); COMP_CWORD={len(words)}; _shtab_gspure; echo ${{COMPREPLY[@]}}"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == expected


def test_without_its_package_completion_names_what_to_install(capsys, monkeypatch):
    monkeypatch.setattr("gspure.plugins.find_spec", lambda name: None)
    assert main(["completion", "zsh"]) == 2
    assert "pip install gspure[completion]" in capsys.readouterr().err
