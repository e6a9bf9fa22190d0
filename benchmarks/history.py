"""CPU time of this commit against a fixed one, measured in turns, and its history: a row of history.csv per run.

``python -m benchmarks.history [ROUNDS]`` appends the ratios of the image and the contributions of a view of a million
Gaussians, and of an audit of 100,000. The documentation shows the last rows.
"""

import csv
import os
import resource
import subprocess
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.against import HERE, once, worker
from benchmarks.room import SMALL
from benchmarks.timing import processor
from gspure.model import write_model

REFERENCE: Final = "44f0201b"
TABLE: Final = Path(__file__).with_name("history.csv")
COLUMNS: Final = ("date", "commit", "processor", "image", "contributions", "audit")
RENDERS: Final = {"image": ("large", "ewa", "image"), "contributions": ("large", "ray", "contributions")}


def reference() -> Path:
    """Return a folder with the files of the fixed commit."""
    folder = HERE / "build" / REFERENCE
    if not folder.exists():
        archive = subprocess.run(["git", "archive", REFERENCE], cwd=HERE, check=True, capture_output=True)
        folder.mkdir(parents=True)
        subprocess.run(["tar", "x", "-C", str(folder)], input=archive.stdout, check=True)
    return folder


def rendering(roots: tuple[Path, Path], case: tuple[str, ...], rounds: int) -> float:
    """Return the median ratio of CPU times of a method of the renderer, this over the other."""
    processes = [worker(root, case) for root in roots]
    for process in 2 * processes:
        once(process)
    times = np.array([[once(process) for process in processes] for _ in range(rounds)])
    for process in processes:
        process.kill()
    return float(np.median(times[:, 1] / times[:, 0]))


def audit(root: Path, model: Path) -> float:
    """Return the CPU seconds of an audit without a key."""
    with tempfile.TemporaryDirectory() as folder:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "gspure", "audit", str(model), "--quiet"]
        subprocess.run(command, cwd=folder, env=os.environ | {"PYTHONPATH": str(root)}, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def auditing(roots: tuple[Path, Path], rounds: int) -> float:
    """Return the median ratio of CPU times of an audit, this over the other."""
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "room.ply"
        write_model(model, SMALL.model)
        times = np.array([[audit(root, model) for root in roots] for _ in range(rounds + 1)])[1:]  # the first compiles
    return float(np.median(times[:, 1] / times[:, 0]))


def main(rounds: int) -> None:
    """Measure, and append a row."""
    roots = (reference(), HERE)
    ratios = {name: rendering(roots, case, 10 * rounds) for name, case in RENDERS.items()}
    ratios["audit"] = auditing(roots, rounds)
    commit = subprocess.check_output(["git", "rev-parse", "--short=8", "HEAD"], cwd=HERE, text=True).strip()
    facts = (f"{datetime.now(UTC):%Y-%m-%d}", commit, processor())
    is_new = not TABLE.exists()
    with TABLE.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if is_new:
            writer.writerow(COLUMNS)
        writer.writerow([*facts, *(f"{ratio:.2f}" for ratio in ratios.values())])
    print(ratios)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
