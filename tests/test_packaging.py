"""Kernels and data are found however gspure is installed, and every list of packages names the same ones."""

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

from tests.documentation import ROOT

FIND = "from gspure.opencl.program import kernel_folder; print(kernel_folder())"


def python(code: str, *, cwd: Path) -> str:
    """Run code in an interpreter that sees neither this folder nor PYTHONPATH."""
    command = [sys.executable, "-I", "-c", code]
    return subprocess.run(command, cwd=cwd, check=True, capture_output=True, text=True).stdout.strip()


def build(hook: str, folder: Path) -> Path:
    """Build a wheel with the build backend, as pip would, and return the folder that it is unpacked into."""
    pytest.importorskip("hatchling")
    name = python(f"import hatchling.build; print(hatchling.build.{hook}({str(folder)!r}))", cwd=ROOT).splitlines()[-1]
    unpacked = folder / "unpacked"
    with zipfile.ZipFile(folder / name) as wheel:
        wheel.extractall(unpacked)
    return unpacked


def test_a_wheel_contains_kernels_workflow_and_data(tmp_path):
    installed = build("build_wheel", tmp_path)
    code = f"import sys; sys.path.insert(0, {str(installed)!r}); from gspure.cli.audit import snakefile; "
    kernels, workflow = map(Path, python(code + FIND + "; print(snakefile().parent)", cwd=tmp_path).splitlines())
    files = {path: kernels / path.name for path in (ROOT / "kernels_cl").glob("*.cl")}
    for folder in ("rules", "schemas", "profiles", "report", "envs"):
        files |= {path: workflow / path.relative_to(ROOT) for path in (ROOT / folder).rglob("*.*")}
    files |= {path: installed / path.relative_to(ROOT) for path in (ROOT / "gspure").rglob("*.csv")}
    files |= {ROOT / "Snakefile": workflow / "Snakefile", ROOT / "gspure/py.typed": installed / "gspure/py.typed"}
    for ours, theirs in files.items():
        assert installed in theirs.parents
        assert theirs.read_bytes() == ours.read_bytes()


def test_an_editable_install_finds_the_kernels_of_the_checkout(tmp_path):
    installed = build("build_editable", tmp_path)
    found = python(f"import site; site.addsitedir({str(installed)!r}); {FIND}", cwd=tmp_path)
    assert Path(found) == ROOT / "kernels_cl"
    assert not list(installed.rglob("*.cl")), "a copy would go stale"


@pytest.mark.parametrize("name", ["opencl", "gl"])
def test_the_checks_of_the_set_up_run(name):
    """The scripts that install drivers ask the package what works, in Python of their own."""
    script = (ROOT / "setup" / f"{name}.sh").read_text()
    (check,) = re.findall(r"<<'END'\n(.*?)^END$", script, re.DOTALL | re.MULTILINE)
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert name != "opencl" or done.returncode == 0  # the tests need a device


def test_conda_installs_what_pip_installs():
    metadata = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    names = {"matplotlib": "matplotlib-base", "snakemake": "snakemake-minimal"}
    required = [re.match(r"([\w-]+)(.*)", text) for text in metadata["dependencies"]]
    expected = {f"{names.get(match[1], match[1])} {match[2]}" for match in required if match}
    environment = yaml.safe_load((ROOT / "envs" / "gspure.yaml").read_text())["dependencies"]
    recipe = yaml.safe_load((ROOT / "envs" / "conda-recipe" / "recipe.yaml").read_text())
    in_snakemake = [*environment, "snakemake-minimal >=9.27,<10"]  # where the environment is used
    for packages in (in_snakemake, recipe["requirements"]["run"]):
        assert {*packages} - {"pocl"} == expected | {f"python {metadata['requires-python']}"}
