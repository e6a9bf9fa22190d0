"""`gspure doctor`: its findings, fixes and exit status."""

import argparse
from dataclasses import replace
from importlib import metadata

import pytest

from gspure.cli import doctor
from gspure.opencl.selftest import Trial

WORKING = Trial(
    index=0, kind="cpu", name="EPYC", platform="PoCL", driver="3.1", selected=True, problem=None, seconds=1.0
)
BROKEN = replace(WORKING, index=1, driver="3.0", problem="unknown target CPU")
UNSELECTED = replace(WORKING, selected=False)


@pytest.fixture
def examine(monkeypatch, capsys):
    """Return a function that runs the doctor on a made-up machine and returns (status, what it printed)."""

    def examine(*trials: Trial, opengl: str | None = "llvmpipe", numpy: str = "2.4.6") -> tuple[int, str]:
        def version(name: str) -> str:
            if not numpy:
                raise metadata.PackageNotFoundError(name)
            return numpy

        monkeypatch.setattr("gspure.opencl.selftest.try_devices", lambda: list(trials))
        monkeypatch.setattr("gspure.figures.plates.opengl_renderer", lambda: opengl)
        monkeypatch.setattr(metadata, "requires", lambda _: ["numpy<3,>=1.26", 'ruff>=0.12; extra == "dev"'])
        monkeypatch.setattr(metadata, "version", version)
        monkeypatch.setattr(doctor, "_make", lambda _: None)
        return doctor.run(argparse.Namespace(fix=False)), capsys.readouterr().out

    return examine


@pytest.mark.parametrize("trials", [(WORKING,), (BROKEN, WORKING)])
def test_a_machine_with_a_working_device_needs_no_fix(examine, trials):
    status, text = examine(*trials)
    assert status == 0
    assert "EPYC  PoCL 3.1  1.0 s, in use" in text
    assert ("unknown target CPU" in text) == (BROKEN in trials)
    assert "fix:" not in text


@pytest.mark.parametrize(
    ("machine", "trials", "fix"),
    [
        ("x86_64", (), "-m pip install intel-opencl-rt intel-cmplr-lib-rt"),
        ("x86_64", (BROKEN,), "-m pip install intel-opencl-rt intel-cmplr-lib-rt"),
        ("aarch64", (), "sudo apt-get install pocl-opencl-icd"),
        ("x86_64", (UNSELECTED,), "unset GSPURE_DEVICE"),
    ],
)
def test_without_a_working_device_the_status_is_1_and_the_fix_one_command(examine, monkeypatch, machine, trials, fix):
    monkeypatch.setattr("platform.machine", lambda: machine)
    status, text = examine(*trials)
    assert status == 1
    (command,) = [line for line in text.splitlines() if "fix: " in line]
    assert command.endswith(fix)


def test_missing_opengl_is_not_a_failure(examine):
    status, text = examine(WORKING, opengl=None)
    assert status == 0
    assert text.count("fix:") == 1


@pytest.mark.parametrize("version", ["", "3.0.0", "1.25"])
def test_a_package_that_is_missing_or_out_of_range_is_named_with_its_fix(examine, version):
    status, text = examine(WORKING, numpy=version)
    assert status == 1
    assert "pip install 'numpy<3,>=1.26'" in text


def test_on_this_machine_the_report_ends_with_a_verdict(capsys):
    status = doctor.run(argparse.Namespace(fix=False))
    verdict = "gspure can run." if status == 0 else "gspure cannot run yet: see the fixes above."
    assert capsys.readouterr().out.splitlines()[-1] == verdict
