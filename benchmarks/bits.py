"""How many bits of Marked Clones are read after attacks, at which damage to the scene: a CSV table.

    .venv/bin/python benchmarks/bits.py docs/results/bits.csv models

It needs PyTorch. The trained models are kept in the folder `models`; attacks in the table are not repeated.
"""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from marked_clones import SCHEME

from gspure.attacks import Measurements, find_attack
from gspure.attacks.strength import scene_damage
from gspure.cli import main
from gspure.evaluation.detection import Reading, detection, share_correct
from gspure.evaluation.metrics import psnr
from gspure.images import read_back
from gspure.method.purify import purify
from gspure.public_model import PublicModel
from gspure.schemes.pair import read_pair
from gspure.schemes.scheme import Key
from gspure.training.dataset import read_photographs

PAIR = ("interior-1", "interior-2")
SIZE = ("--views", "24", "--width", "160", "--height", "120")
SETTINGS = ("--set", "iterations=1200", "--set", "max_gaussians=12000")
DAMAGES = (0.3, 1.0, 2.0)
SEARCHED = ("gspure_scaled", "plain_weight", "random_pruning", "gaussian_noise")
LEARNING = ("finetune", "prune_repair", "reestimate", "distil")
COLUMNS = ("attack", "damage", "strength", "cpu", "scene_drop", "clones_left", "views")
COLUMNS += ("bits", "deviation", "tpr_1", "tpr_01")


def models(folder: Path) -> None:
    """Trace the pair, and train the marked and the clean model."""
    if not (folder / "pair").exists():
        assert main(["pair", *PAIR, *SIZE, "--out", str(folder / "pair")]) == 0
    for name, weight in {"marked": [], "clean": ["--set", "message_weight=0"]}.items():
        if not (folder / name).exists():
            words = ["embed", "marked_clones", str(folder / "pair"), *SETTINGS, *weight]
            assert main([*words, "--out", str(folder / name)]) == 0


def table(path: Path, folder: Path) -> None:
    """Complete the table."""
    models(folder)
    pair, key = read_pair(folder / "pair"), SCHEME.read_key(folder / "marked" / "key")
    marked = SCHEME.read_public(folder / "marked" / "public")
    cameras = {"training": pair.scene.views, "held out": pair.scene.dataset.test}
    photographs = read_photographs(cameras["held out"])
    damage_of = scene_damage(marked, cameras["held out"], photographs, None)
    purified = purify(marked, pair.scene.views)
    measurements = Measurements(purified.weights, purified.prune_mask, labels=purified.labels)

    def add(attack: str, damage: str, strength: str, cpu: float, model: PublicModel, left: str, by: Key = key) -> None:
        drop = quality(marked, cameras["held out"], photographs) - quality(model, cameras["held out"], photographs)
        for name, views in cameras.items():
            read = detection(correct(by, model, views), [])
            shares = (f"{x:.1f}" for x in (read.level, read.spread, 100 * read.tpr, 100 * read.tpr_strict))
            rows.append((attack, damage, strength, f"{cpu:.1f}", f"{drop:.2f}", left, name, *shares))
        with path.open("w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])

    rows = [tuple(row) for row in csv.reader(path.open())][1:] if path.is_file() else []
    known = {row[:2] for row in rows}
    if ("clean", "") not in known:
        add("clean", "", "", 0, SCHEME.read_public(folder / "clean" / "public"), "")
        add("wrong_key", "", "", 0, marked, "100.0", key.wrong(np.random.default_rng(1)))
    runs = [("unattacked", None), ("gspure", None), *((name, None) for name in LEARNING)]
    runs += [(name, damage) for name in SEARCHED for damage in DAMAGES]
    for name, damage in runs:
        if (name, f"{damage or ''}") in known:
            continue
        attack, settings, strength = find_attack(name), {}, ""
        if damage:
            search = attack.matching(marked, measurements, damage, damage_of, cameras=pair.scene.views)
            settings, strength = {search.setting: search.value}, f"{search.setting}={search.value:.4g}"
        begin = time.process_time()
        attacked = attack.apply(marked, measurements, cameras=pair.scene.views, **settings)
        cpu = time.process_time() - begin
        left = f"{100 * np.mean(~attacked.prune_mask[key.message_rows]):.1f}"
        add(name, f"{damage or ''}", strength, cpu, marked.with_model(attacked.model), left)


def correct(key: Key, model: PublicModel, cameras: Sequence) -> list[Reading]:
    """Return the share of correct bits in 8-bit renders, in percent."""
    scene = model.scene()
    shares = (share_correct(key.read_bits(read_back(scene(camera))), key.bits) for camera in cameras)
    return [Reading(camera.name, share, len(key.bits)) for camera, share in zip(cameras, shares, strict=True)]


def quality(model: PublicModel, cameras: Sequence, photographs: Sequence) -> float:
    """Return the mean PSNR over views."""
    scene = model.scene()
    return float(np.mean([psnr(p, read_back(scene(c))) for c, p in zip(cameras, photographs, strict=True)]))


if __name__ == "__main__":
    table(Path(sys.argv[1]), Path(sys.argv[2]))
