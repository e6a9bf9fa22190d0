"""Peak memory of the work on one model, against the size of its file.

Resident memory counts the device's buffers (a CPU device keeps them in the same memory), the pages of the mapped file,
which the system takes back when it needs them, and Python, the driver and its compiler: these are told by the same work
on a thousand Gaussians.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from findings import Findings
from room import room
from scenes import LARGE

from gspure.model import Gaussians, write_model


def sizes(path: Path, model: Gaussians) -> dict[str, tuple[float, float]]:
    """Return (peak so far, resident now without mapped files) in MB after each step."""
    write_model(path, model)
    script = Path(__file__).with_name("one_model.py")
    command = [sys.executable, str(script), str(path), str(LARGE.width), str(LARGE.height)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return {step: (float(peak), float(own)) for step, peak, own in map(str.split, done.stdout.splitlines())}


def test_memory(findings: Findings, tmp_path: Path) -> None:
    path = tmp_path / "room.ply"
    fixed, _ = sizes(path, room(1000))["image"]
    found = sizes(path, LARGE.model)
    file = path.stat().st_size / 1e6
    findings.figure("model file, MB", file)
    for step, (peak, own) in found.items():
        findings.figure(f"{step}: peak so far, MB", peak)
        findings.figure(f"{step}: resident without mapped files, MB", own)
    findings.figure("the same work on 1000 Gaussians: peak, MB", fixed)
    peak, own = found["image"]
    findings.figure("peak / file", peak / file, at_most=3.0)
    findings.figure("(peak - that of 1000 Gaussians) / file", (peak - fixed) / file)
    findings.figure("resident without mapped files / file", own / file)
