"""Peak memory of the work on one model, against the size of its file.

Resident memory counts: the pages of the mapped file, the device's buffers (a CPU device keeps them in the same memory),
Python, the driver and its compiler. What the last three take is told by the same work on a thousand Gaussians.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from findings import Findings
from room import room
from scenes import LARGE

from gspure.model import Gaussians, write_model


def peaks(path: Path, model: Gaussians) -> dict[str, float]:
    """Return the largest resident size in MB after each step."""
    write_model(path, model)
    script = Path(__file__).with_name("one_model.py")
    command = [sys.executable, str(script), str(path), str(LARGE.width), str(LARGE.height)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return {step: float(size) for step, size in map(str.split, done.stdout.splitlines())}


def test_memory_peak(findings: Findings, tmp_path: Path) -> None:
    path = tmp_path / "room.ply"
    fixed = peaks(path, room(1000))
    found = peaks(path, LARGE.model)
    size = path.stat().st_size / 1e6
    findings.figure("model file, MB", size)
    for step, peak in found.items():
        findings.figure(f"peak up to {step}, MB", peak)
    findings.figure("peak / file", found["image"] / size, at_most=3.0)
    findings.figure("peak of the same with 1000 Gaussians, MB", fixed["image"])
    findings.figure("peak beyond that / file", (found["image"] - fixed["image"]) / size)
