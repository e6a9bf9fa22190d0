"""CPU time of this checkout against another one, measured in turns.

``python -m benchmarks.against CHECKOUT [ROUNDS]`` prints the medians of both checkouts' times for the image and the
contributions of a view, and of the ratios of neighbouring measurements.
"""

import os
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parents[1]
WORKER = """
import sys, time
from benchmarks.room import LARGE, SMALL
from gspure.renderer import Renderer
scene = dict(small=SMALL, large=LARGE)[sys.argv[1]]
renderer = Renderer(scene.model, energy=sys.argv[2])
for line in sys.stdin:
    begin = time.process_time()
    getattr(renderer, sys.argv[3])(scene.camera)
    print(time.process_time() - begin, flush=True)
"""
"""A program that renders once for every line of input, and prints its CPU seconds."""


def worker(root: Path, case: tuple[str, ...]) -> subprocess.Popen[str]:
    """Return a process of the checkout at `root`, whose modules come first."""
    command = [sys.executable, "-c", WORKER, *case]
    environment = os.environ | {"PYTHONPATH": str(root)}
    return subprocess.Popen(
        command, text=True, cwd=root, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )


def once(process: subprocess.Popen[str]) -> float:
    """Return the CPU seconds of one piece of work."""
    assert process.stdin
    assert process.stdout
    print(file=process.stdin, flush=True)
    return float(process.stdout.readline())


def compare(reference: Path, rounds: int) -> None:
    """Print the table of this checkout against a `reference`."""
    print("| case | other, ms | this, ms | this / other |\n| --- | --- | --- | --- |")
    for case in product(("small", "large"), ("ray", "ewa"), ("image", "contributions")):
        processes = [worker(root, case) for root in (reference, HERE)]
        for process in 2 * processes:
            once(process)
        times = np.array([[once(process) for process in processes] for _ in range(rounds)])
        for process in processes:
            process.kill()
        theirs, ours = 1e3 * np.median(times, axis=0)
        ratio = np.median(times[:, 1] / times[:, 0])
        print(f"| {', '.join(case)} | {theirs:.1f} | {ours:.1f} | {ratio:.3f} |", flush=True)


if __name__ == "__main__":
    compare(Path(sys.argv[1]).resolve(), int(sys.argv[2]) if len(sys.argv) > 2 else 31)
