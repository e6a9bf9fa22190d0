"""`gspure doctor`: its findings, fixes and exit status."""

import argparse
import re
from dataclasses import replace
from importlib import metadata

import pytest

from gspure.cli import doctor
from gspure.figures.probe import OpenGL
from gspure.opencl.selftest import Trial

WORKING = Trial(
    index=0, kind="cpu", name="EPYC", platform="PoCL", driver="3.1", selected=True, problem=None, seconds=1.0
)
BROKEN = replace(WORKING, index=1, driver="3.0", problem="unknown target CPU")
UNSELECTED = replace(WORKING, selected=False)


@pytest.fixture
def examine(monkeypatch, capsys):
    """Return a function that runs the doctor on a made-up machine and returns (status, what it printed)."""

    def examine(*trials: Trial, opengl: str | None = None, versions: dict[str, str] | None = None) -> tuple[int, str]:
        drawn = OpenGL(None if opengl else "llvmpipe", opengl)
        installed = {"numpy": "2.4.6", "snakemake": "9.27.1"} | (versions or {})

        def version(name: str) -> str:
            if installed.get(name, "") == "":
                raise metadata.PackageNotFoundError(name)
            return installed[name]

        wanted = ["numpy<3,>=1.26", "snakemake<10,>=9.0", 'ruff>=0.12; extra == "dev"']
        monkeypatch.setattr("gspure.opencl.selftest.try_devices", lambda: list(trials))
        monkeypatch.setattr("gspure.figures.probe.try_opengl", lambda: drawn)
        monkeypatch.setattr(metadata, "requires", lambda _: wanted)
        monkeypatch.setattr(metadata, "version", version)
        return doctor.run(argparse.Namespace(fix=False)), capsys.readouterr().out

    return examine


def test_a_complete_machine_passes(examine) -> None:
    status, text = examine(WORKING)
    assert status == 0
    assert "EPYC  PoCL 3.1  1.0 s, in use" in text
    assert "ok  numpy" in text
    assert "ruff" not in text
    assert "fix:" not in text


def test_a_broken_device_beside_a_working_one_does_no_harm(examine) -> None:
    status, text = examine(BROKEN, WORKING)
    assert status == 0
    assert "unknown target CPU" in text
    assert "fix:" not in text


@pytest.mark.parametrize("trials", [(), (BROKEN,)])
def test_without_a_working_device_the_status_is_1(examine, trials) -> None:
    status, text = examine(*trials)
    assert status == 1
    assert "no working device" in text
    assert text.count("fix:") == 1
    assert re.search("opencl|pocl", text.split("fix:")[1])


@pytest.mark.parametrize(
    ("machine", "trials", "route"),
    [
        ("x86_64", [], "-m pip install intel-opencl-rt intel-cmplr-lib-rt"),
        ("x86_64", [BROKEN], "-m pip install intel-opencl-rt intel-cmplr-lib-rt"),
        ("aarch64", [], "sudo apt-get install pocl-opencl-icd"),
    ],
)
def test_a_driver_comes_from_pip_where_its_package_works(examine, monkeypatch, machine, trials, route) -> None:
    monkeypatch.setattr(doctor, "_make", lambda _: None)
    monkeypatch.setattr("platform.machine", lambda: machine)
    assert examine(*trials)[1].split("fix: ")[1].splitlines()[0].endswith(route)


def test_a_device_named_in_the_environment_must_work(examine, monkeypatch) -> None:
    monkeypatch.setenv("GSPURE_DEVICE", "nvidia")
    status, text = examine(UNSELECTED)
    assert status == 1
    assert "fix: unset GSPURE_DEVICE" in text


def test_missing_opengl_is_not_a_failure(examine) -> None:
    status, text = examine(WORKING, opengl="off-screen rendering ends the process (status -11)")
    assert status == 0
    assert "3-D figures are drawn without it" in text
    assert text.count("fix:") == 1


@pytest.mark.parametrize("version", ["", "3.0.0", "1.25"])
def test_a_package_that_is_missing_or_out_of_range_is_named_with_its_fix(examine, version) -> None:
    status, text = examine(WORKING, versions={"numpy": version})
    assert status == 1
    assert "pip install 'numpy<3,>=1.26'" in text


def test_on_this_machine_the_report_is_aligned_and_ends_with_a_verdict(capsys) -> None:
    status = doctor.run(argparse.Namespace(fix=False))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("gspure ")
    assert lines[-1] == ("gspure can run." if status == 0 else "gspure cannot run yet: see the fixes above.")
    names = [line for line in lines if line.startswith(("  ok  numpy ", "  ok  snakemake "))]
    assert len({line.index(line.split()[2]) for line in names}) <= 1
