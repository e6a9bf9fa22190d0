"""The OpenCL sources are found however gspure is installed: as a wheel, as an editable install, as a plain checkout."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
KERNELS = sorted((ROOT / "kernels_cl").glob("*.cl"))

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


def test_a_wheel_brings_the_kernels_with_it(tmp_path: Path) -> None:
    installed = build("build_wheel", tmp_path)
    found = Path(python(f"import sys; sys.path.insert(0, {str(installed)!r}); {FIND}", cwd=tmp_path))
    assert found == installed / "gspure" / "kernels_cl"
    assert [path.name for path in sorted(found.glob("*.cl"))] == [path.name for path in KERNELS]
    assert all((found / path.name).read_bytes() == path.read_bytes() for path in KERNELS)
    assert (installed / "gspure" / "py.typed").is_file()


def test_an_editable_install_finds_the_kernels_of_the_checkout(tmp_path: Path) -> None:
    installed = build("build_editable", tmp_path)
    found = python(f"import site; site.addsitedir({str(installed)!r}); {FIND}", cwd=tmp_path)
    assert Path(found) == ROOT / "kernels_cl"
    assert not list(installed.rglob("*.cl")), "a copy would go stale"


def test_a_plain_checkout_finds_its_own_kernels(tmp_path: Path) -> None:
    found = python(f"import sys; sys.path.insert(0, {str(ROOT)!r}); {FIND}", cwd=tmp_path)
    assert Path(found) == ROOT / "kernels_cl"
