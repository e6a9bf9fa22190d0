"""`gspure doctor`: its findings, fixes and exit status."""

import argparse
import re
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
DRIVER = "-m pip install intel-opencl-rt intel-cmplr-lib-rt"


@pytest.mark.parametrize(
    ("trials", "machine", "opengl", "numpy", "status", "fix"),
    [
        ((WORKING,), "x86_64", "llvmpipe", "2.4.6", 0, None),
        ((BROKEN, WORKING), "x86_64", "llvmpipe", "2.4.6", 0, None),
        ((), "x86_64", "llvmpipe", "2.4.6", 1, DRIVER),
        ((BROKEN,), "x86_64", "llvmpipe", "2.4.6", 1, DRIVER),
        ((), "aarch64", "llvmpipe", "2.4.6", 1, "sudo apt-get install pocl-opencl-icd"),
        ((UNSELECTED,), "x86_64", "llvmpipe", "2.4.6", 1, "unset GSPURE_DEVICE"),
        ((WORKING,), "x86_64", None, "2.4.6", 0, "sudo apt-get install libegl1 libgl1-mesa-dri"),
        ((WORKING,), "x86_64", "llvmpipe", None, 1, "-m pip install 'numpy<3,>=1.26'"),
        ((WORKING,), "x86_64", "llvmpipe", "3.0.0", 1, "-m pip install 'numpy<3,>=1.26'"),
    ],
)
def test_each_fault_has_one_fix(monkeypatch, capsys, trials, machine, opengl, numpy, status, fix):
    def version(name):
        if not numpy:
            raise metadata.PackageNotFoundError(name)
        return numpy

    monkeypatch.setattr("gspure.opencl.selftest.try_devices", lambda: list(trials))
    monkeypatch.setattr("gspure.figures.plates.opengl_renderer", lambda: opengl)
    monkeypatch.setattr(metadata, "requires", lambda _: ["numpy<3,>=1.26", 'ruff>=0.12; extra == "dev"'])
    monkeypatch.setattr(metadata, "version", version)
    monkeypatch.setattr("platform.machine", lambda: machine)
    monkeypatch.setattr(doctor, "_make", lambda _: None)
    assert doctor.run(argparse.Namespace(fix=False)) == status
    text = capsys.readouterr().out
    assert ("EPYC  PoCL 3.1  1.0 s, in use" in text) == (WORKING in trials)
    assert re.search(r"ok  rendered_bits +scheme  gspure_marked_clones 1\.0$", text, re.MULTILINE)
    fixes = [line for line in text.splitlines() if "fix: " in line]
    assert len(fixes) == (fix is not None)
    assert not fix or fixes[0].endswith(fix)
