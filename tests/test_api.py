"""The public interface: what it offers, what importing it costs."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import gspure

SOURCE = Path(gspure.__file__).read_text(encoding="utf-8")
ROOT = Path(gspure.__file__).parents[1]


@pytest.mark.parametrize("name", gspure.__all__)
def test_every_public_name_is_there_and_documented(name):
    found = getattr(gspure, name)
    assert getattr(gspure, name) is found
    assert name == "__version__" or found.__doc__
    assert f"`{name}`" in gspure.__doc__ or name == "__version__"


def test_type_checkers_see_the_very_objects_that_programs_get():
    imports = [node for node in ast.walk(ast.parse(SOURCE)) if isinstance(node, ast.ImportFrom)]
    seen = {alias.name: node.module for node in imports for alias in node.names if node.module.startswith("gspure.")}
    assert {*seen, "__version__"} == set(gspure.__all__)
    for name, module in seen.items():
        assert getattr(gspure, name) is getattr(sys.modules[module], name)


def test_public_names_are_listed_and_others_refused():
    assert set(gspure.__all__) <= set(dir(gspure))
    with pytest.raises(AttributeError, match="'gspure' has no attribute 'purge'"):
        _ = gspure.purge


def test_importing_the_package_imports_nothing_else_of_it_and_no_other_package():
    program = "import sys; import gspure; print(*{name.split('.')[0] for name in sys.modules if name != 'gspure'})"
    done = subprocess.run([sys.executable, "-S", "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    assert set(done.stdout.split()) <= {*sys.stdlib_module_names, "__main__"}
