"""What literal, adaptive and oracle owners read after attacks, and what hardening costs and saves: a CSV table.

    .venv/bin/python benchmarks/owners.py docs/results/owners.csv models [SCHEME ...]

It needs PyTorch for GS-Hider and SecureGS. Trained models are kept in the folder `models`, and attacks in the table are
not repeated, so an interrupted table is completed.
"""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gspure.attacks import Measurements, find_attack
from gspure.cli import main
from gspure.cli.extract import FIT_STEPS
from gspure.evaluation.metrics import psnr
from gspure.images import read_back
from gspure.method.purify import purify
from gspure.method.weights import accumulate
from gspure.public_model import Lesson, PublicModel, RenderView
from gspure.schemes.hidden_weight import hidden_weights, share_on_low
from gspure.schemes.pair import Capture, Pair, read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import ADAPTIVE, Key, Scheme
from gspure.training.dataset import read_photographs

SPLATS = {"iterations": 1200, "max_gaussians": 12_000}
MODELS = [
    *(("splats_in_splats", "shared", seed, SPLATS) for seed in (0, 1)),
    *(("splats_in_splats_hardened", "shared", seed, SPLATS) for seed in (0, 1)),
    *(("gs_hider", protocol, 0, {"iterations": 600, "max_gaussians": 8000}) for protocol in ("shared", "own")),
    *(("secure_gs", protocol, 0, {"iterations": 800, "max_anchors": 4000}) for protocol in ("shared", "own")),
]
PRUNING = {
    "gspure": {},
    "plain_weight": {"tau": 4.0},
    "plain_weight, tau 1": {"tau": 1.0},
    "random_pruning": {"fraction": 0.25},
    "prune_repair": {},
}
CHANGES = {
    "gspure": {},
    "prune_repair": {},
    "reestimate": {},
    "gaussian_noise": {"sigma": 0.5},
    "rigid_transform": {"angle": 0.0, "translation": "1,0,0"},
}
COLUMNS = ("scheme", "protocol", "seed", "attack", "cpu", "extraction", "scene", "message", "low_share")


Rows = list[dict[str, object]]


def measured(
    name: str, protocol: str, seed: int, settings: dict[str, int], folder: Path, known: set[str]
) -> Iterator[Rows]:
    """Train or read a model, and yield the rows of each attack that is not known."""
    scheme, size = find_scheme(name), ("--views", "24", "--width", "96", "--height", "72", "--protocol", protocol)
    place, data = folder / f"{name}-{protocol}-{seed}", folder / f"pair-{protocol}"
    if not data.exists():
        assert main(["pair", "interior-1", "interior-2", *size, "--out", str(data)]) == 0
    chosen = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    for target, weight in ((place, []), (place / "clean", ["--set", "message_weight=0"])):
        if not (target / "public").exists():
            words = ["embed", name, str(data), "--seed", str(seed), *chosen, *weight, "--out", str(target)]
            assert main(words) == 0
    pair, public, key = read_pair(data), scheme.read_public(place / "public"), scheme.read_key(place / "key")
    weights = accumulate(map(public.contributions(), pair.scene.views), len(public.model))
    hidden = hidden_weights(public, key, list(scheme.extractions)[-1], pair.message.views, "ray")
    low = share_on_low(weights, hidden, 4.0)
    for attack, options in {"unattacked": {}, "clean": {}, **(CHANGES if scheme.fits else PRUNING)}.items():
        if attack in known:
            continue
        model, transform, cpu = attacked(attack, options, scheme, public, weights, pair, place)
        scene, rows = quality(model.scene(), pair.scene, transform), []
        for extraction in scheme.extractions:
            view = shown(scheme, key, model, extraction, pair.message, transform)
            message = quality(view, pair.message, transform)
            psnrs = (f"{scene:.2f}", f"{message:.2f}")
            values = (name, protocol, seed, attack, f"{cpu:.1f}", extraction, *psnrs, f"{low:.3f}")
            rows.append(dict(zip(COLUMNS, values, strict=True)))
        yield rows


def attacked(
    attack: str, options: dict, scheme: Scheme, public: PublicModel, weights: np.ndarray, pair: Pair, place: Path
) -> tuple[PublicModel, np.ndarray, float]:
    """Return the attacked model, its rigid transform, and CPU seconds, without those of the weights."""
    if attack == "clean":
        return scheme.read_public(place / "clean" / "public"), np.eye(4), 0.0
    begin, measurements = time.process_time(), Measurements(weights)
    if attack == "gspure":
        mask = purify(public, pair.scene.views, tau_c=scheme.tau_c, tau_n=scheme.tau_n).prune_mask
        begin, measurements = time.process_time(), Measurements(weights, mask)
    done = find_attack(attack.partition(",")[0]).apply(public, measurements, cameras=pair.scene.views, **options)
    transform = np.eye(4) if done.transform is None else done.transform
    return public.with_model(done.model), transform, time.process_time() - begin


def shown(
    scheme: Scheme, key: Key, model: PublicModel, extraction: str, message: Capture, transform: np.ndarray
) -> RenderView:
    """Return the renderer of the message; a fitting owner learns from the training views first."""
    if scheme.fits and extraction == ADAPTIVE:
        views = [camera.moved(transform) for camera in message.views]
        key = key.fitted(model, Lesson(views, message.images, (), FIT_STEPS, np.random.default_rng(0)))
    return key.message(model, extraction)


def quality(view: RenderView, capture: Capture, transform: np.ndarray) -> float:
    """Return the mean PSNR over the held-out views."""
    cameras: Sequence = capture.dataset.test
    photographs = read_photographs(cameras)
    moved = [camera.moved(transform) for camera in cameras]
    return float(np.mean([psnr(i, read_back(view(c))) for c, i in zip(moved, photographs, strict=True)]))


def table(path: Path, folder: Path, schemes: Sequence[str]) -> None:
    """Complete the table."""
    rows = list(csv.DictReader(path.open())) if path.is_file() else []
    for name, protocol, seed, settings in MODELS:
        if schemes and name not in schemes:
            continue
        of_model = [row for row in rows if (row["scheme"], row["protocol"], row["seed"]) == (name, protocol, str(seed))]
        for new in measured(name, protocol, seed, settings, folder, {row["attack"] for row in of_model}):
            rows += new
            with path.open("w", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
                writer.writeheader()
                writer.writerows(rows)


if __name__ == "__main__":
    table(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
