"""The public interface: what it offers, what importing it costs, what it needs PyTorch for."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import gspure
from gspure.errors import InputError

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


def test_the_bridge_without_torch_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    for name in ("pytorch", "torch_bridge"):
        monkeypatch.delitem(sys.modules, f"gspure.training.{name}", raising=False)
    with pytest.raises(InputError, match=r"^torch: package: expected PyTorch, .*pip install gspure\[torch\]"):
        import gspure.training.torch_bridge  # noqa: F401
