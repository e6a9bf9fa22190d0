"""What GSPure does to schemes of different capacity on one pair of random rooms: a CSV table.

    .venv/bin/python benchmarks/capacity.py docs/results/capacity.csv

It needs PyTorch. Runs in the table are not repeated, so an interrupted table is completed.
"""

from __future__ import annotations

import csv
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gspure.cameras import Camera
from gspure.cli import main
from gspure.evaluation.metrics import psnr
from gspure.method.purify import purify
from gspure.public_model import RenderView
from gspure.schemes.pair import read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import MESSAGE, hide
from gspure.training.dataset import read_photographs

ITERATIONS = 1000
RUNS = [
    (scheme, protocol, setting, bound)
    for scheme, setting, bounds in (
        ("splats_in_splats", "max_gaussians", (3000, 12_000, 48_000)),
        ("secure_gs", "max_anchors", (2000, 6000, 20_000)),
        ("gs_hider", "max_gaussians", (3000, 10_000, 30_000)),
    )
    for bound in bounds
    for protocol in ("shared", "own")
]
COLUMNS = (
    *("scheme", "protocol", "setting", "bound", "iterations", "rows", "removed"),
    *("scene", "message", "scene_drop", "message_drop", "random_scene_drop", "random_message_drop"),
)


def capacity(name: str, protocol: str, setting: str, bound: int) -> dict[str, object]:
    """Train, purify and measure: PSNR and its drops in dB, means over the held-out views."""
    scheme = find_scheme(name)
    with tempfile.TemporaryDirectory() as folder:
        size = ("--views", "24", "--width", "96", "--height", "72", "--protocol", protocol)
        assert main(["pair", "interior-1", "interior-2", *size, "--out", folder + "/pair"]) == 0
        pair = read_pair(Path(folder, "pair"))
        photographs = [read_photographs(capture.dataset.test) for capture in (pair.scene, pair.message)]
    public, key = hide(scheme, pair, **{"iterations": ITERATIONS, setting: bound})
    pruned = purify(public, pair.scene.views, tau_c=scheme.tau_c, tau_n=scheme.tau_n).prune_mask
    random = np.random.default_rng(0).permutation(pruned)
    quality = [
        [
            mean_psnr(view, capture.dataset.test, images)
            for view, capture, images in zip(
                (model.scene(), key.message(model, MESSAGE)), (pair.scene, pair.message), photographs, strict=True
            )
        ]
        for model in (public, *(public.with_model(public.model[~mask]) for mask in (pruned, random)))
    ]
    (scene, message), *attacked = quality
    drops = [before - after for kind in attacked for before, after in zip((scene, message), kind, strict=True)]
    numbers = [len(pruned), pruned.mean(), scene, message, *drops]
    return dict(zip(COLUMNS, [name, protocol, setting, bound, ITERATIONS, *numbers], strict=True))


def mean_psnr(view: RenderView, cameras: Sequence[Camera], photographs: Sequence[np.ndarray]) -> float:
    """Return the mean PSNR over views."""
    return float(np.mean([psnr(view(c).clip(0, 1), image) for c, image in zip(cameras, photographs, strict=True)]))


def table(path: Path) -> None:
    """Complete the table."""
    rows = list(csv.DictReader(path.open())) if path.is_file() else []
    done = {(row["scheme"], row["protocol"], row["bound"]) for row in rows}
    for run in RUNS:
        if (run[0], run[1], str(run[3])) in done:
            continue
        row = capacity(*run)
        rows.append({name: f"{value:.2f}" if isinstance(value, float) else value for name, value in row.items()})
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    table(Path(sys.argv[1]))
