"""This checkout against another one: CPU time, measured in turns.

``python against.py CHECKOUT views|schemes [ROUNDS]`` prints medians of both checkouts' times and of the ratios
of neighbouring measurements: of image and contributions of a view, or of an iteration of the schemes that need PyTorch.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

from gspure.cli import main

HERE = Path(__file__).resolve().parents[1]
WORKERS = {
    "views": """
import sys, time
sys.path[:0] = ["benchmarks"]
from room import LARGE, SMALL
from gspure.renderer import Renderer
scene = dict(small=SMALL, large=LARGE)[sys.argv[1]]
renderer = Renderer(scene.model, energy=sys.argv[2])
for line in sys.stdin:
    begin = time.process_time()
    getattr(renderer, sys.argv[3])(scene.camera)
    print(time.process_time() - begin, flush=True)
""",
    "schemes": """
import importlib, sys, time
from pathlib import Path
from gspure.schemes.pair import read_pair
def watched(run, *_):
    steps = iter(run)
    for line in sys.stdin:
        begin = time.process_time()
        for _ in range(5):
            next(steps)
        yield print((time.process_time() - begin) / 5, flush=True)
embedding = importlib.import_module(f"gspure.schemes.{sys.argv[1]}.embedding")
embedding.watched = watched
bound = {"gs_hider": dict(iterations=1000, max_gaussians=10000), "secure_gs": dict(iterations=1500, max_anchors=6000)}
embedding.embed(read_pair(Path(sys.argv[2])), 0, message_weight=float(sys.argv[3]), **bound[sys.argv[1]])
""",
}
"""Programs that do their work once for every line of input, and print its CPU seconds."""


def cases(kind: str, folder: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield names and arguments of a worker's cases."""
    if kind == "views":
        for words in product(("small", "large"), ("ray", "ewa"), ("image", "contributions")):
            yield ", ".join(words), [*words]
        return
    for width, height in ((96, 72), (160, 120)):
        pair = str(folder / f"{width}x{height}")
        size = ("--views", "24", "--width", str(width), "--height", str(height), "--protocol", "own")
        assert main(["pair", "interior-1", "interior-2", *size, "--out", pair, "--quiet"]) == 0
        for scheme in ("gs_hider", "secure_gs"):
            yield f"{scheme} @{width}x{height}", [scheme, pair, "0.5"]
            yield f"{scheme}, clean model @{width}x{height}", [scheme, pair, "0"]


def worker(root: Path, kind: str, arguments: list[str]) -> subprocess.Popen[str]:
    """Return a process of the checkout at `root`."""
    environment = os.environ | {"PYTHONPATH": str(root)}
    command = [sys.executable, "-c", WORKERS[kind], *arguments]  # which looks for modules in `root` first
    return subprocess.Popen(
        command, text=True, cwd=root, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )


def once(process: subprocess.Popen[str]) -> float:
    """Return the CPU seconds of one piece of work."""
    assert process.stdin
    assert process.stdout
    print(file=process.stdin, flush=True)
    return float(process.stdout.readline())


def compare(other: Path, kind: str, rounds: int) -> None:
    """Print the table."""
    print("| case | other, ms | this, ms | this / other |\n| --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in cases(kind, Path(folder)):
            processes = [worker(root, kind, arguments) for root in (other, HERE)]
            for process in 2 * processes:
                once(process)
            times = np.array([[once(process) for process in processes] for _ in range(rounds)])
            for process in processes:
                process.kill()
            theirs, ours = 1e3 * np.median(times, axis=0)
            ratio = np.median(times[:, 1] / times[:, 0])
            print(f"| {name} | {theirs:.1f} | {ours:.1f} | {ratio:.3f} |", flush=True)


if __name__ == "__main__":
    compare(Path(sys.argv[1]).resolve(), sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else 31)
