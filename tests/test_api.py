"""The public interface: what it offers, what importing it costs, what it needs PyTorch for."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import gspure
from gspure.errors import InputError
from tests.models import blobs

SOURCE = Path(gspure.__file__)


def test_type_checkers_see_the_very_objects_that_programs_get():
    imports = [node for node in ast.walk(ast.parse(SOURCE.read_text())) if isinstance(node, ast.ImportFrom)]
    seen = {alias.name: node.module for node in imports for alias in node.names if node.module.startswith("gspure.")}
    assert {*seen} == {*gspure.__all__}
    for name, module in seen.items():
        assert getattr(gspure, name) is getattr(sys.modules[module], name)
        assert f"`{name}`" in gspure.__doc__
    with pytest.raises(AttributeError, match="'gspure' has no attribute 'purge'"):
        _ = gspure.purge


def test_importing_the_package_imports_nothing_else_of_it_and_no_other_package():
    program = "import sys; import gspure; print(*{name.split('.')[0] for name in sys.modules if name != 'gspure'})"
    command = [sys.executable, "-S", "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=SOURCE.parents[1])
    assert set(done.stdout.split()) <= {*sys.stdlib_module_names, "__main__"}


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
    for name in ("pytorch", "torch_bridge"):
        monkeypatch.delitem(sys.modules, f"gspure.training.{name}", raising=False)
    with pytest.raises(InputError, match=r"^torch: package: expected PyTorch, .*pip install 'gspure\[torch\]"):
        import gspure.training.torch_bridge  # noqa: F401
