"""`gspure purify` from file to file: CPU time, and peak memory against the memory that it announces."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.findings import Findings
from benchmarks.room import LARGE, panning, room
from gspure.cameras import Camera, write_cameras
from gspure.method.purify import peak_memory
from gspure.model import read_model, write_model

VIEWS = 23
"""20 for the weights, and every eighth for the metrics."""

ROOM = 12e9
"""Bytes that six million Gaussians may take."""


def peak_of(command: list[str]) -> tuple[float, float]:
    """Run a command; return its largest resident size in bytes, including mapped files, and its CPU seconds."""
    before = sum(os.times()[2:4])
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        peak = 0
        while True:
            # Linux counts the parent's size into getrusage's ru_maxrss, but not into this.
            status = Path(f"/proc/{process.pid}/status").read_text(encoding="ascii")
            peak = max([peak, *map(int, re.findall(r"VmHWM:\s*(\d+) kB", status))])
            try:
                process.wait(0.2)
                break
            except subprocess.TimeoutExpired:
                continue
    assert process.returncode == 0
    return 1024 * peak, sum(os.times()[2:4]) - before


@pytest.mark.parametrize("count", [1_000_000, 6_000_000], ids=["1M", "6M"])
def test_purify(count: int, findings: Findings, tmp_path: Path) -> None:
    if os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") < ROOM:
        pytest.skip("too little memory")
    path = tmp_path / "room.ply"
    peak, cpu, announced = purify(path, count, panning(VIEWS, LARGE.width, LARGE.height))
    findings.figure("model file, GB", path.stat().st_size / 1e9)
    findings.figure("20 views, clusters, pruning, metrics, figures: CPU seconds", cpu)
    findings.figure("peak memory, GB", peak / 1e9, at_most=ROOM / 1e9)
    findings.figure("peak memory / memory announced", peak / announced, at_most=1.0)


def test_purify_with_large_images(findings: Findings, tmp_path: Path) -> None:
    peak, _, announced = purify(tmp_path / "room.ply", 10_000, panning(2, 1600, 20_000))
    findings.figure("32 million pixels: peak memory, GB", peak / 1e9)
    findings.figure("32 million pixels: peak memory / memory announced", peak / announced, at_most=1.0)


def purify(path: Path, count: int, cameras: list[Camera]) -> tuple[float, float, float]:
    """Purify a room of `count` Gaussians; return peak memory in bytes, CPU seconds, and announced memory in bytes."""
    write_model(path, room(count))
    views = path.with_name("cameras.json")
    write_cameras(views, cameras)
    options = ("--cameras", str(views), "--out", str(path.with_name("out")))
    peak, cpu = peak_of([sys.executable, "-m", "gspure", "purify", str(path), *options])
    return peak, cpu, peak_memory(read_model(path), cameras)
