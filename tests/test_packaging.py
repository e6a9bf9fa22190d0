"""Kernels, workflow and data are in the wheel, and conda installs what pip installs."""

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

from tests.documentation import ROOT


def python(code: str, *, cwd: Path) -> list[str]:
    """Return the lines that code prints in an interpreter that sees neither this folder nor PYTHONPATH."""
    command = [sys.executable, "-I", "-c", code]
    return subprocess.run(command, cwd=cwd, check=True, capture_output=True, text=True).stdout.splitlines()


def test_a_wheel_contains_kernels_workflow_and_data(tmp_path):
    pytest.importorskip("hatchling")
    name = python(f"import hatchling.build; print(hatchling.build.build_wheel({str(tmp_path)!r}))", cwd=ROOT)[-1]
    installed = tmp_path / "installed"
    zipfile.ZipFile(tmp_path / name).extractall(installed)
    code = f"import sys; sys.path.insert(0, {str(installed)!r}); from gspure.workflow.auditing import snakefile; "
    code += "from gspure.opencl.program import kernel_folder; from gspure.schemes.registry import find_scheme; "
    code += "print(kernel_folder(), snakefile().parent, find_scheme('keyss').embed.__code__.co_filename, sep='\\n')"
    kernels, workflow, of_plugin = map(Path, python(code, cwd=tmp_path))
    assert of_plugin == installed / "gspure_torch/keyss/__init__.py"
    files = {path: kernels / path.name for path in (ROOT / "kernels_cl").glob("*.cl")}
    for folder in ("rules", "profiles"):
        files |= {path: workflow / path.relative_to(ROOT) for path in (ROOT / folder).rglob("*.*")}
    files |= {path: installed / path.relative_to(ROOT) for path in (ROOT / "gspure").rglob("*.csv")}
    files |= {path: installed / path.relative_to(ROOT) for path in (ROOT / "gspure/workflow/plugins").rglob("*.py")}
    files |= {path: installed / path.relative_to(ROOT) for path in (ROOT / "gspure").rglob("templates/*")}
    files |= {ROOT / name: workflow / name for name in ("Snakefile", "config/config.yaml", "config/config.schema.json")}
    files |= {path: installed / path.relative_to(ROOT) for path in (ROOT / "gspure_torch").rglob("*.py")}
    files |= {path: installed / path.relative_to(ROOT) for path in ROOT.glob("gspure*/py.typed")}
    for ours, theirs in files.items():
        assert installed in theirs.parents
        assert theirs.read_bytes() == ours.read_bytes()


def test_conda_installs_what_pip_installs():
    metadata = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    names = {"matplotlib": "matplotlib-base", "snakemake": "snakemake-minimal"}
    required = [re.match(r"([\w-]+)(.*)", text) for text in metadata["dependencies"]]
    expected = {f"{names.get(match[1], match[1])} {match[2]}" for match in required if match}
    environment = yaml.safe_load((ROOT / "rules" / "envs" / "gspure.yaml").read_text())["dependencies"]
    recipe = yaml.safe_load((ROOT / "rules" / "envs" / "conda-recipe" / "recipe.yaml").read_text())
    in_snakemake = [*environment, "snakemake-minimal >=9.27,<10"]  # where the environment is used
    for packages in (in_snakemake, recipe["requirements"]["run"]):
        assert {*packages} - {"pocl"} == expected | {f"python {metadata['requires-python']}"}
