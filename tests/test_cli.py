"""The command line and the public interface: what importing costs, help, refusals in one line, exit statuses."""

import ast
import re
import shlex
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import gspure
from gspure import cli
from gspure.cli import COMMANDS, main
from gspure.errors import InputError
from gspure.model import read_model, write_model
from tests.models import blobs

HEAVY = ("numpy", "scipy", "pyopencl", "hdbscan", "pyvista", "matplotlib", "plyfile", "rich", "jinja2", "PIL")
HEAVY_FOR_HELP = {"--help": HEAVY, "render --help": HEAVY, "train --help": HEAVY, "embed --help": ("torch",)}
RENDER = ["render", "model.ply", "--cameras", "cameras.json", "--split", "test", "--out", "out"]


@pytest.mark.parametrize(("line", "heavy"), HEAVY_FOR_HELP.items())
def test_help_imports_nothing_heavy(line, heavy):
    words = line.split()
    code = f"import sys\nfrom gspure.cli import main\ntry: main({words})\nfinally: print(*sys.modules.keys() & {heavy})"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == ""


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_accepts_its_examples(command):
    module = import_module(f"gspure.cli.{command.replace('-', '_')}")
    lines = module.EXAMPLES.replace("\\\n", " ").splitlines()
    examples = [shlex.split(line, comments=True) for line in lines if line.startswith("  gspure ")]
    assert {words[1] for words in examples} == {command}
    for words in examples:
        cli.parser_of(command).parse_args(words[2:])


def test_help_lists_installed_schemes_with_their_packages(capsys):
    with pytest.raises(SystemExit):
        main(["embed", "--help"])
    of_package = r"^schemes of gspure_marked_clones 1\.0:\n  marked_clones +iterations=\d+"
    assert re.search(of_package, capsys.readouterr().out, re.MULTILINE)


def test_help_after_an_attack_tells_what_it_does_and_its_strength(capsys):
    with pytest.raises(SystemExit) as leaving:
        main(["attack", "jpeg", "--help"])
    assert not leaving.value.code
    text = capsys.readouterr().out
    assert gspure.find_attack("jpeg").function.__doc__.partition("\n")[0] in text
    assert "`quality`, smaller is stronger" in text


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("bogus", "no command 'bogus'"),
        ("render", "required"),
        ("purfy model.ply", "did you mean purify?"),
        ("render m.ply --cameras c.json --otu=x", "did you mean --out?"),
        ("cameras c.json --out cameras.txt", "--out: expected a name that ends with .json, found"),
        ("attack crop --model m --out m.ply --set x", "--set: expected NAME=VALUE, found 'x'"),
        ("purify m --cameras orbit --out o --tau-c 0", "--tau-c: expected a number above 0"),
    ],
)
def test_a_wrong_command_line_is_refused_in_one_line_with_status_2(line, expected, capsys):
    with pytest.raises(SystemExit) as leaving:
        main(shlex.split(line))
    assert leaving.value.code == 2
    reason = capsys.readouterr().err
    assert expected in reason
    assert reason.index("\n") == len(reason) - 1


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (InputError("model", "rows", expected="many", found="few"), "model.ply: rows: expected many, found few"),
        (MemoryError("1 TB"), "out of memory: 1 TB"),
    ],
)
def test_an_error_becomes_one_line_that_names_the_file(monkeypatch, asset, capsys, error, line):
    def refuse(_args):
        raise error

    monkeypatch.setattr("gspure.cli.render.run", refuse)
    assert main(RENDER) == 2
    assert capsys.readouterr().err == f"gspure render: {line}\n"


def test_quiet_leaves_out_progress_but_no_warning(asset, capsys):
    rows = read_model("model.ply")
    write_model("model.ply", rows.with_columns({"x": np.append(rows.table["x"][:-1], np.float32(np.nan))}))
    assert main([*RENDER, "--quiet"]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: ")
    assert main(RENDER) == 0
    assert len(capsys.readouterr().err.splitlines()) > 1


def test_a_shell_completes_commands_options_and_files(asset, capsys):
    pytest.importorskip("shtab", reason="gspure[completion] is not installed")
    assert main(["completion", "bash"]) == 0
    Path("gspure.bash").write_text(capsys.readouterr().out)
    script = "source gspure.bash\n"
    for line in ("pur", "purify --ca", "render x.ply --cameras mod", "render --split te"):
        words = f"COMP_WORDS=(gspure {line}); COMP_CWORD={len(line.split())}"
        script += f"COMPREPLY=(); {words}; _shtab_gspure; echo ${{COMPREPLY[@]}}\n"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["purify", "--cameras", "model.ply", "test"]


def test_type_checkers_see_the_very_objects_that_programs_get():
    tree = ast.parse(Path(gspure.__file__).read_text())
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    seen = {alias.name: node.module for node in imports for alias in node.names if node.module.startswith("gspure.")}
    assert {*seen} == {*gspure.__all__}
    for name, module in seen.items():
        assert getattr(gspure, name) is getattr(sys.modules[module], name)
        assert f"`{name}`" in gspure.__doc__
    with pytest.raises(AttributeError, match="'gspure' has no attribute 'purge'"):
        _ = gspure.purge


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: gspure.purify(blobs(1), "orbit"), r"purify: cameras: .*'orbit' \(gspure.read_cameras"),
        (lambda: gspure.purify(Path("model.ply"), []), r"purify: model: .*\(gspure.read_model"),
        (lambda: gspure.Renderer("model.ply"), r"Renderer: model: .*\(gspure.read_model"),
        (lambda: gspure.read_cameras("orbit"), r"read_cameras: path: .*\(gspure.cameras.orbit_cameras\(model\)"),
    ],
)
def test_a_name_in_place_of_what_it_names_is_refused_with_the_function_that_reads_it(call, line):
    with pytest.raises(InputError, match=f"^{line}"):
        call()


def test_the_bridge_without_torch_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    for name in ("pytorch", "bridge"):
        monkeypatch.delitem(sys.modules, f"gspure_torch.{name}", raising=False)
    with pytest.raises(InputError, match=r"^torch: package: expected PyTorch, .*pip install 'gspure\[torch\]"):
        import gspure_torch.bridge  # noqa: F401
