"""Contributions of this checkout against those of another one: CPU time of a view, measured in turns.

``python against.py CHECKOUT [ROUNDS]`` prints, for each scene and energy, the median of the two checkouts' times and of
the ratios of neighbouring measurements.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parents[1]
WORKER = """
import sys, time
sys.path[:0] = [{root!r} + "/benchmarks"]
from scenes import SMALL, LARGE
from gspure.renderer import Renderer
scene = dict(small=SMALL, large=LARGE)[sys.argv[1]]
renderer = Renderer(scene.model, energy=sys.argv[2])
for line in sys.stdin:
    begin = time.process_time()
    renderer.contributions(scene.camera)
    print(time.process_time() - begin, flush=True)
"""


def worker(root: Path, scene: str, energy: str) -> subprocess.Popen[str]:
    """Return a process of the checkout at `root` that takes the contributions of a view for every line it gets."""
    code = WORKER.format(root=str(root))
    environment = os.environ | {"PYTHONPATH": str(root)}
    command = [sys.executable, "-c", code, scene, energy]  # which looks for modules in the working directory first
    return subprocess.Popen(
        command, text=True, cwd=root, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )


def once(process: subprocess.Popen[str]) -> float:
    """Return the CPU seconds of one view."""
    assert process.stdin
    assert process.stdout
    print(file=process.stdin, flush=True)
    return float(process.stdout.readline())


def compare(other: Path, rounds: int) -> None:
    """Print the table."""
    print("| scene | energy | other, ms | this, ms | this / other |\n| --- | --- | --- | --- | --- |")
    for scene in ("small", "large"):
        for energy in ("ray", "ewa"):
            processes = [worker(root, scene, energy) for root in (other, HERE)]
            for process in 2 * processes:
                once(process)
            times = np.array([[once(process) for process in processes] for _ in range(rounds)])
            for process in processes:
                process.kill()
            theirs, ours = 1e3 * np.median(times, axis=0)
            ratio = np.median(times[:, 1] / times[:, 0])
            print(f"| {scene} | {energy} | {theirs:.1f} | {ours:.1f} | {ratio:.3f} |", flush=True)


if __name__ == "__main__":
    compare(Path(sys.argv[1]).resolve(), int(sys.argv[2]) if len(sys.argv) > 2 else 31)
