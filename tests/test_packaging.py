"""Kernels are found however gspure is installed (wheel, editable, checkout), and the set-up can ask it what works."""

import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
KERNELS = sorted((ROOT / "kernels_cl").glob("*.cl"))

IGNORED = {line.rstrip("/") for line in (ROOT / ".gitignore").read_text().splitlines()} | {".git"}

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
        wheel.extractall(unpacked)  # noqa: S202 (our own)
    return unpacked


def test_a_wheel_contains_kernels_and_data(tmp_path: Path) -> None:
    installed = build("build_wheel", tmp_path)
    found = Path(python(f"import sys; sys.path.insert(0, {str(installed)!r}); {FIND}", cwd=tmp_path))
    assert found == installed / "gspure" / "kernels_cl"
    assert [path.name for path in sorted(found.glob("*.cl"))] == [path.name for path in KERNELS]
    assert all((found / path.name).read_bytes() == path.read_bytes() for path in KERNELS)
    assert (installed / "gspure" / "py.typed").is_file()
    code = "from gspure.cli.audit import snakefile; print(snakefile())"
    workflow = Path(python(f"import sys; sys.path.insert(0, {str(installed)!r}); {code}", cwd=tmp_path)).parent
    assert installed in workflow.parents
    folders = ("rules", "schemas", "profiles", "report", "envs")
    for file in (ROOT / "Snakefile", *(path for name in folders for path in (ROOT / name).rglob("*.*"))):
        assert (workflow / file.relative_to(ROOT)).read_bytes() == file.read_bytes()
    data = [path.relative_to(ROOT) for path in (ROOT / "gspure").rglob("*.csv")]
    assert data
    assert all((installed / path).read_bytes() == (ROOT / path).read_bytes() for path in data)


def test_a_source_distribution_is_the_whole_checkout(tmp_path: Path) -> None:
    pytest.importorskip("hatchling")
    name = python(f"import hatchling.build; print(hatchling.build.build_sdist({str(tmp_path)!r}))", cwd=ROOT)
    with tarfile.open(tmp_path / name.splitlines()[-1]) as archive:
        packed = {Path(*Path(member).parts[1:]) for member in archive.getnames()}
    ours = [path for path in ROOT.rglob("*") if path.suffix in {".py", ".cl", ".smk", ".md", ".cff", ".sh", ".yaml"}]
    tracked = {path.relative_to(ROOT) for path in ours if not IGNORED & set(path.relative_to(ROOT).parts)}
    assert len(tracked) > 200
    assert tracked <= packed
    assert not IGNORED & {path.parts[0] for path in packed if path.parts}


def test_an_editable_install_finds_the_kernels_of_the_checkout(tmp_path: Path) -> None:
    installed = build("build_editable", tmp_path)
    found = python(f"import site; site.addsitedir({str(installed)!r}); {FIND}", cwd=tmp_path)
    assert Path(found) == ROOT / "kernels_cl"
    assert not list(installed.rglob("*.cl")), "a copy would go stale"


def test_a_plain_checkout_finds_its_own_kernels(tmp_path: Path) -> None:
    found = python(f"import sys; sys.path.insert(0, {str(ROOT)!r}); {FIND}", cwd=tmp_path)
    assert Path(found) == ROOT / "kernels_cl"


@pytest.mark.parametrize("name", ["opencl", "gl"])
def test_the_checks_of_the_set_up_run(name):
    """The scripts that install drivers ask the package what works, in Python of their own."""
    script = (ROOT / "setup" / f"{name}.sh").read_text()
    (check,) = re.findall(r"<<'END'\n(.*?)^END$", script, re.DOTALL | re.MULTILINE)
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    if name == "opencl":  # the tests need a device
        assert (done.returncode, done.stdout[:6]) == (0, "setup:")


def test_conda_installs_what_pip_installs() -> None:
    metadata = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    names = {"matplotlib": "matplotlib-base", "snakemake": "snakemake-minimal"}
    required = [re.match(r"([\w-]+)(.*)", text) for text in metadata["dependencies"]]
    expected = {f"{names.get(match[1], match[1])} {match[2]}" for match in required if match}
    environment = yaml.safe_load((ROOT / "envs" / "gspure.yaml").read_text())["dependencies"]
    recipe = yaml.safe_load((ROOT / "envs" / "conda-recipe" / "recipe.yaml").read_text())
    for packages in (
        [*environment, "snakemake-minimal >=9.27,<10"],
        recipe["requirements"]["run"],
    ):  # it runs in Snakemake
        assert {*packages} - {"pocl"} == expected | {f"python {metadata['requires-python']}"}
