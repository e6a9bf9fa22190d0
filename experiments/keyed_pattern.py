"""Keyed patterns under attack: tables/keyed_pattern.csv, and false positives and cost of a certificate beside it.

gspure pair room vault --views 32 --width 208 --height 156 --out pair
python -m experiments.keyed_pattern pair
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest, kstest

from benchmarks.room import panning, room
from gspure.attacks import Attacked, Measurements, find_attack
from gspure.attacks.collusion import RULES
from gspure.attacks.strength import scene_damage
from gspure.files import write_text
from gspure.method.purify import purify
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.sign_ranks import largest_sums
from gspure.model import Gaussians, write_model
from gspure.public_model import PublicModel
from gspure.schemes.keyed_pattern.key import SMOOTHED, Findings, KeyedPatternKey
from gspure.schemes.keyed_pattern.pattern import Pattern, marked
from gspure.schemes.keyed_pattern.strength import strongest
from gspure.schemes.pair import Pair, read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import hide
from gspure.training.dataset import read_photographs

TABLES = Path(__file__).resolve().parent / "tables"
SETTINGS: dict[str, Any] = {"iterations": 2000, "max_gaussians": 20_000}
STRANGERS: dict[str, Any] = {"iterations": 500, "max_gaussians": 8000}
DISTILLATION = 2000
DAMAGE = 0.3  # of embedding, dB
KEYS = 1000
CERTIFIED = 1_000_000
LEVEL = 0.001
ANSWERED = "collusion, unmark"  # what a finer bank is for
FINER = ((0.005, 1), (0.0075, 1))  # clip and passes of further references, of a finer bank
COLUMNS = ("attack", "strength", "damage", "z rows", "z clean model", "z bank", "p", "correct bits of 32")

Result = tuple[str, str, Attacked]


class FinerKey(KeyedPatternKey):
    """The key of an owner with more references."""

    bank = (*FINER, *SMOOTHED)


class Trial(NamedTuple):
    """A marked model, its owner's key, and what attacks on it need."""

    pair: Pair
    public: PublicModel
    key: KeyedPatternKey

    def attacked(self, name: str, model: Gaussians | None = None, **settings: Any) -> Attacked:
        """Return the result of an attack on the marked model, or on another one."""
        attack = find_attack(name)
        public = self.public if model is None else PublicModel(model)
        measurements = Measurements(opacities=public.model.opacities)
        if attack.needs & {"weights", "prune_mask"}:
            purified = purify(public, self.pair.scene.views)
            measurements = replace(measurements, weights=purified.weights, prune_mask=purified.prune_mask)
        cameras = self.pair.scene.views if "teacher" in attack.parameters else ()
        return attack.apply(public, measurements, cameras=cameras, **settings)


def simple(trial: Trial) -> Iterator[Result]:
    """Yield the results of single attacks."""
    attacks: list[tuple[str, dict[str, Any]]] = [
        ("unattacked", {}),
        ("quantize", {"bits": 16}),
        ("compression", {"codec": "spz"}),
        ("compression", {"codec": "sog"}),
        ("sh_edit", {"sigma": 0.02}),
        ("sh_edit", {"sigma": 0.0, "factor": 0.5}),
        ("warp", {"amplitude": 0.001}),
        ("warp", {"amplitude": 0.003}),
        ("warp", {"amplitude": 0.01}),
        ("split", {"fraction": 1.0}),
        ("merge_pairs", {"fraction": 0.1}),
        ("rigid_transform", {"angle": 30.0, "scale": 1.1}),
        ("feature_scaling", {"factor": 1.2}),
        ("gaussian_noise", {"sigma": 0.1}),
        ("prune_repair", {"tau": 4.0}),
        ("gspure", {}),
        ("reestimate", {}),
        ("finetune", {"render": "jpeg:50"}),
        ("densify", {}),
        ("remesh", {}),
        ("crop", {"fraction": 0.9}),
        ("crop", {"fraction": 0.5}),
        ("unmark", {"clip": 0.006, "passes": 1}),
        ("unmark", {"clip": 0.01, "passes": 1}),
        ("unmark", {"clip": 0.015, "passes": 2}),
        ("unmark", {"clip": 0.02, "passes": 3}),
        ("unmark", {"clip": 0.03, "passes": 4}),
    ]
    for name, settings in attacks:
        strength = " ".join(f"{setting}={value}" for setting, value in settings.items())
        yield name, strength, trial.attacked(name, **settings)


def combined(trial: Trial) -> Iterator[Result]:
    """Yield the results of attacks one after another."""
    steps = f"{DISTILLATION} steps"
    distilled = trial.attacked("distil", iterations=DISTILLATION)
    yield "distil", steps, distilled
    for render in ("jpeg:50", "jpeg:20", "blur:1", "median:1", "resize:0.5"):
        yield "distil", f"{steps}, render={render}", trial.attacked("distil", iterations=DISTILLATION, render=render)
    turned = trial.attacked("rigid_transform", distilled.model, angle=30.0, scale=1.1, translation="0.3,0,0.2")
    yield "distil, rigid_transform", steps, turned
    smoothed = trial.attacked("unmark", clip=0.015, passes=2).model
    yield "unmark, distil", f"clip=0.015 passes=2, {steps}", trial.attacked("distil", smoothed, iterations=DISTILLATION)
    rng = np.random.default_rng(7)
    own = Pattern.of(rng.bytes(32), b"", trial.key.bits)
    overwritten = marked(smoothed, trial.key.grid, own, 0.01)
    rows = np.arange(len(overwritten))
    yield "unmark, a second mark", "clip=0.015 passes=2, strength 0.01", Attacked(overwritten, rows, len(rows))


def colluding(trial: Trial) -> Iterator[Result]:
    """Yield what n owners of differently marked copies make of them."""
    key = trial.key
    others = [KeyedPatternKey.random(np.random.default_rng([9, n]), 32, key.clean, key.views) for n in range(15)]
    copies = [strongest(key.clean, other.pattern, trial.pair.scene, DAMAGE) for other in others]
    for count in (2, 4, 16):
        with TemporaryDirectory() as folder:
            for number, copy in enumerate(copies[: count - 1]):
                write_model(Path(folder, f"{number}.ply"), copy)
            mixtures = {rule: trial.attacked("collusion", copies=folder, rule=rule) for rule in RULES}
        for rule, mixture in mixtures.items():
            yield "collusion", f"{count} copies, {rule}", mixture
    for clip in (0.004, 0.006, 0.007, 0.01):
        cleared = trial.attacked("unmark", mixtures["interleave"].model, clip=clip, passes=1)
        yield ANSWERED, f"{count} copies, interleave, clip={clip} passes=1", cleared


def controls(trial: Trial) -> Iterator[tuple[str, PublicModel, KeyedPatternKey]]:
    """Yield models and keys that prove nothing."""
    yield "clean model", PublicModel(trial.key.clean), trial.key
    yield "wrong key", trial.public, trial.key.wrong(np.random.default_rng(1))
    stranger, _ = hide(find_scheme("keyed_pattern"), trial.pair, seed=1, message_weight=0, **STRANGERS)
    yield "another training", stranger, trial.key


def attack_rows(trial: Trial) -> Iterator[list[str]]:
    """Yield the rows of the table of attacks."""
    yield embedding_row(trial)
    for name, public, key in controls(trial):
        yield row(name, "", float("nan"), key, public)
    for results in (simple, colluding, combined):
        yield from judged(trial, results(trial))


def embedding_row(trial: Trial) -> list[str]:
    """Return the row of the marked model, whose damage is that by embedding."""
    test = trial.pair.scene.dataset.test
    damage = scene_damage(PublicModel(trial.key.clean), test, read_photographs(test))(trial.public)
    return row("embedding", "", damage, trial.key, trial.public)


def judged(trial: Trial, results: Iterator[Result]) -> Iterator[list[str]]:
    """Yield a row for each result, and for those of colluders who erase a mark one more, with a finer bank."""
    key = trial.key
    finer = FinerKey(key.secret, key.bits, key.clean, key.views)
    clips = ", ".join(f"clip={clip}" for clip, _ in FINER)
    test = trial.pair.scene.dataset.test
    damage_of = scene_damage(trial.public, test, read_photographs(test))
    for name, strength, attacked in results:
        public = PublicModel(attacked.model)
        damage = damage_of(public, attacked.transform)
        yield row(name, strength, damage, key, public)
        if name == ANSWERED:
            yield row(name, f"{strength}, bank also of {clips}", damage, finer, public)


def row(name: str, strength: str, damage: float, key: KeyedPatternKey, public: PublicModel) -> list[str]:
    """Return a row: what the owner reads, from each of the tries and in all."""
    findings = key.findings(public)
    mark = key.pattern.mark(findings.cells)
    sums = (findings.tries * mark).sum(axis=(1, 2)).tolist()
    if len(sums) <= 1 + len(key.bank):  # the clean model does not differ from itself
        sums.insert(1, float("nan"))
    certificate = key.certificate(findings, CERTIFIED - 1 if name == "unattacked" else 9_999)
    correct = int((key.decoded(findings) == key.bits).sum())
    numbers = [damage, *sums[:2], max(sums[2:])]
    cells = [
        name,
        strength,
        *("" if np.isnan(x) else f"{x:.2f}" if i == 0 else f"{x:.1f}" for i, x in enumerate(numbers)),
    ]
    print(*cells, f"{certificate.p:.1e}", correct, flush=True)
    return [*cells, f"{certificate.p:.1e}", str(correct)]


def false_positives(trial: Trial) -> Iterator[list[str]]:
    """Yield how often keys prove something on models without a mark, and whether p-values are uniform."""
    strangers: list[Gaussians] = []
    for seed in range(1, 6):
        stranger, _ = hide(find_scheme("keyed_pattern"), trial.pair, seed=seed, message_weight=0, **STRANGERS)
        strangers.append(stranger.model)
        for name, settings in (("compression", {"codec": "spz"}), ("gaussian_noise", {}), ("unmark", {})):
            strangers.append(trial.attacked(name, stranger.model, **settings).model)
    values = [p for stranger in strangers for p in p_values(trial.key, trial.key.findings(PublicModel(stranger)))]
    hits = int(np.count_nonzero(np.array(values) <= LEVEL))
    interval = binomtest(hits, len(values)).proportion_ci()
    yield ["models without a mark", str(len(strangers))]
    yield ["keys", str(KEYS)]
    yield [f"false positives at p <= {LEVEL}", str(hits)]
    yield ["their rate", f"{hits / len(values):.5f} [{interval.low:.5f}, {interval.high:.5f}]"]
    yield ["Kolmogorov-Smirnov, 500 keys, one model", f"{kstest(values[:500], 'uniform').pvalue:.2f}"]


def p_values(key: KeyedPatternKey, findings: Findings) -> Iterator[float]:
    """Yield the p-value of each of some keys."""
    tries = findings.tries.reshape(len(findings.tries), -1)
    others = np.sort(largest_sums(tries, 9_999))
    for number in range(KEYS):
        mark = Pattern.of(number.to_bytes(4, "big"), b"", key.bits).mark(findings.cells).ravel()
        yield (1 + len(others) - np.searchsorted(others, np.max(tries @ mark))) / (1 + len(others))


def cost() -> Iterator[list[str]]:
    """Yield what a certificate costs on a large synthetic model."""
    clean = room(100_000)
    key = KeyedPatternKey.random(np.random.default_rng(0), 32, clean, panning(12, 400, 300))
    public = PublicModel(marked(clean, key.grid, key.pattern, 0.005))
    begin = time.process_time()
    findings = key.findings(public)
    read = time.process_time()
    certificate = key.certificate(findings, CERTIFIED)
    yield ["rows; views", "100000; 12 of 400x300"]
    yield ["cells", str(len(findings.cells))]
    yield ["CPU s: renders and cells", f"{read - begin:.0f}"]
    yield [f"CPU s: rank among {CERTIFIED} keys", f"{time.process_time() - read:.0f}"]
    yield ["p; z", f"{certificate.p:.1e}; {certificate.z:.1f}"]


def main() -> None:
    """Write both tables."""
    pair = read_pair(Path(sys.argv[1]))
    public, key = hide(find_scheme("keyed_pattern"), pair, **SETTINGS)
    assert isinstance(key, KeyedPatternKey)
    trial = Trial(pair, public, key)
    write_text(TABLES / "keyed_pattern.csv", csv_text(COLUMNS, attack_rows(trial)))
    write_text(TABLES / "keyed_pattern-keys.csv", csv_text(("quantity", "value"), [*false_positives(trial), *cost()]))


if __name__ == "__main__":
    main()
