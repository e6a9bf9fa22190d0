"""Models with and without a message, as they are and attacked: the calibration of `gspure scan`, and its ROC.

``python -m experiments.scan models FOLDER`` trains, attacks and stores models, except those that are stored already. It
needs PyTorch and the plug-in marked_clones. ``python -m experiments.scan tables FOLDER [FILE ...]`` measures the stored
models, and FILEs from elsewhere, and writes results/scan/models.csv, tables/scan.csv and gspure/scan/calibration.csv.
Rows of models that FOLDER lacks, and those of FILEs if none is given, stay as committed.
"""

import csv
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest

from experiments.roc import detectability
from gspure.attacks import Measurements, NotApplicable, find_attack
from gspure.cameras import Camera, read_cameras, split
from gspure.cli import main
from gspure.files import filling, write_text
from gspure.grouping import grouped
from gspure.method.purify import purify
from gspure.method.weights import accumulate
from gspure.metrics.csv_tables import csv_text, write_table
from gspure.model import Gaussians, read_model
from gspure.opencl.trainable import TrainableModel
from gspure.public_model import PublicModel
from gspure.scan.statistics import STATISTICS, measure
from gspure.scan.verdict import LIKELY, LIKENESS, TABLE, Clean, flagged, judge, likeness
from gspure.scenes import photography
from gspure.schemes.pair import Pair, read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import hide
from gspure.schemes.splats_in_splats.bits import SHIFT
from gspure.surface.distances import mesh_distances
from gspure.surface.meshing import extract_mesh, smoothed
from gspure.training.output import as_gaussians
from gspure.training.schedule import Schedule
from gspure.training.trainer import Trainer, beginning

HERE = Path(__file__).resolve().parent
MODELS = HERE / "results" / "scan" / "models.csv"
NAMES = ("family", "model", "scene", "attack", "verdict")  # its columns of text
RATE = 0.01  # of false positives, of all statistics together
CLEAN = "clean"
FOUND = "found"
ENCRYPTED = "encrypted_bits"
SCHEMES: dict[str, tuple[int, str, dict[str, Any]]] = {  # number of models, scheme, its settings
    CLEAN: (50, "splats_in_splats", {"message_weight": 0}),
    "splats_in_splats": (14, "splats_in_splats", {"iterations": 1000}),
    "splats_in_splats_hardened": (7, "splats_in_splats_hardened", {"iterations": 1000}),
    ENCRYPTED: (14, "splats_in_splats", {}),
    "keyss": (7, "keyss", {"iterations": 1000}),
    "marked_clones": (7, "marked_clones", {"iterations": 1000, "decoder_steps": 300, "marking_steps": 200}),
    "gs_hider": (2, "gs_hider", {"iterations": 150}),
    "gs_hider_hardened": (1, "gs_hider_hardened", {"iterations": 150}),
    "secure_gs": (2, "secure_gs", {"iterations": 200}),
}
FAMILIES = tuple(SCHEMES)
PAIRS = (  # scene and message; even ones share their poses
    "room interior-500",
    "vault interior-500",
    "object-1 interior-502",
    "interior-1 landscape-503",
    "landscape-2 object-504",
    "object-2 interior-505",
    "interior-3 object-506",
    "object-3 interior-507",
    "interior-4 object-508",
    "interior-5 vault",
)
SIZES = ((3000, 200), (6000, 60), (3000, 100), (12000, 100), (6000, 300), (12000, 600), (3000, 60), (30000, 300))
"""Most rows, and points of each of 24 views of 96x72 pixels. With more points than rows, models do not grow."""

ROUNDS = ((1, 1000), (2, 1000), (0.5, 3000), (1, 5000), (1, 2000))  # factor of the rows, and iterations of clean models
LARGE = {  # most rows, points of each of 24 views of 160x120 pixels, and iterations of clean models
    **dict.fromkeys(((CLEAN, 30), (CLEAN, 35), ("splats_in_splats", 7)), (100_000, 2500, 1000)),
    **dict.fromkeys(((CLEAN, 40), (CLEAN, 41), (CLEAN, 42), (CLEAN, 46)), (30_000, 250, 3000)),
}
ATTACKS: dict[str, tuple[str, dict[str, Any]]] = {
    **{name: (name, {}) for name in ("unattacked", "gspure", "random_pruning", "prune_repair", "finetune")},
    "quantize_16": ("quantize", {"bits": 16}),
    "quantize_8": ("quantize", {"bits": 8}),
    "spz": ("compression", {"codec": "spz"}),
    "compressed_ply": ("compression", {"codec": "compressed_ply"}),
    **{name: (name, {}) for name in ("reorder", "gof")},
}
FORMATS: dict[str, tuple[str, dict[str, Any]]] = {  # further files of `OTHERS`
    name: ("compression", {"codec": name}) for name in ("sog", "splat", "ksplat")
}
LARGE_FILES = ("unattacked", "compressed_ply", "spz", "splat")  # of those with more than `ATTACKED_ROWS`
ATTACKED_ROWS = 50_000
RATES = (  # columns of tables/scan.csv: detected by the file alone, with Wilson's interval of the rate
    "family",
    "attack",
    "models",
    "detected",
    "low",
    "high",
    "detected with cameras",
    "AUC",
    "AUC low",
    "AUC high",
    "statistic that detects most, and of how many",
)
Row = dict[str, Any]
GOF_ROWS = 7000  # most rows of a model whose mesh is computed


class Other(NamedTuple):
    """A clean model with the habits of other trainers: its SH degree, size, and a stop amid a longer schedule."""

    sh_degree: int
    rows: int
    points: int  # of each of 24 views
    size: tuple[int, int]
    schedule: int  # iterations
    stop: int  # iteration of the file


SMALL = (96, 72)
MIDDLE = (160, 120)
OTHERS = {  # by number of the clean model
    50: Other(0, 6000, 200, SMALL, 1000, 1000),
    51: Other(2, 6000, 200, SMALL, 1000, 1000),
    52: Other(0, 20_000, 400, SMALL, 1000, 1000),
    53: Other(2, 20_000, 400, SMALL, 1000, 1000),
    54: Other(3, 120_000, 4000, MIDDLE, 600, 600),
    55: Other(2, 250_000, 11_000, MIDDLE, 300, 300),
    56: Other(3, 10_000, 400, SMALL, 100, 100),
    57: Other(3, 6000, 200, SMALL, 300, 300),
    58: Other(3, 500_000, 21_500, (200, 150), 200, 200),
    59: Other(0, 500_000, 21_500, (200, 150), 200, 200),
    60: Other(3, 12_000, 400, SMALL, 3000, 700),  # resets of the opacities follow iterations 600 and 1200
    61: Other(3, 12_000, 400, SMALL, 3000, 1250),
    62: Other(0, 12_000, 400, SMALL, 3000, 650),
    63: Other(2, 30_000, 1000, SMALL, 3000, 800),
    64: Other(3, 30_000, 1000, SMALL, 3000, 1300),
}


class Case(NamedTuple):
    """One trained model."""

    family: str
    number: int

    @property
    def pair(self) -> int:
        return self.number % len(PAIRS)

    @property
    def other(self) -> Other | None:
        return OTHERS.get(self.number)

    @property
    def is_large(self) -> bool:
        return self in LARGE

    @property
    def rows(self) -> int:
        factor, _ = ROUNDS[self.number // len(PAIRS)]
        return LARGE[self][0] if self.is_large else int(factor * SIZES[self.pair % 8][0])

    @property
    def points(self) -> int:
        if self.other:
            return self.other.points
        return LARGE[self][1] if self.is_large else SIZES[self.pair % 8][1]

    @property
    def size(self) -> tuple[int, int]:
        if self.other:
            return self.other.size
        return MIDDLE if self.is_large else SMALL


def cases() -> list[Case]:
    """Return all cases, in turns by family, large models last."""
    known = [Case(family, number) for family, (count, *_) in SCHEMES.items() for number in range(count)]
    known += [Case(CLEAN, number) for number in OTHERS]
    return sorted(known, key=lambda case: (case.is_large, case.number / SCHEMES[case.family][0]))


def traced(case: Case, folder: Path) -> Path:
    """Return the folder of the case's pair; trace it unless it is stored."""
    scene, message = PAIRS[case.pair].split()
    photography.PER_VIEW = case.points
    protocol = ("shared", "own")[case.pair % 2]
    placement = ("raised", "behind", "front", "raised")[case.pair // 2 % 4]
    pair = folder / "pairs" / f"{scene}-{message}-{protocol}-{case.points}"
    width, height = map(str, case.size)
    size = ("--views", "24", "--width", width, "--height", height)
    options = ("--protocol", protocol, "--placement", placement, *size, "--out", str(pair), "--quiet")
    assert pair.is_dir() or main(("pair", scene, message, *options)) == 0
    return pair


def encrypted(model: Gaussians, rng: np.random.Generator) -> Gaussians:
    """Return a marked model with its hidden bits under a stream cipher: an owner who adapts to tests of the bits."""
    room = np.array([SHIFT + int(j**0.5) for j in range(16)], np.uint32)[:, None]
    words = np.ascontiguousarray(model.sh_coeffs).view(np.uint32)
    stream = rng.integers(2**32, size=words.shape, dtype=np.uint32) & ((np.uint32(1) << room) - np.uint32(1))
    return model.with_appearance(model.table["opacity"], (words ^ stream).view(np.float32))


def build(case: Case, folder: Path) -> None:
    """Train and attack a model, unless it is stored."""
    place = folder / f"{case.family}-{case.number:02d}"
    if place.is_dir():
        return
    _, scheme, settings = SCHEMES[case.family]
    scene_only = case.family == CLEAN and (case.pair % 2 or case.number // len(PAIRS) % 2)
    pair = read_pair(traced(case, folder), "scene" if scene_only else "both")
    if case.other:
        public = stopped(pair, case.other, case.number)
    elif case.family == ENCRYPTED:
        public = PublicModel.read(folder / f"{scheme}-{case.number:02d}" / "unattacked" / "point_cloud.ply")
        public = public.with_model(encrypted(public.model, np.random.default_rng(case.number)))
    else:
        _, clean_iterations = ROUNDS[case.number // len(PAIRS)]
        if case.is_large:
            _, _, clean_iterations = LARGE[case]
        settings = {"iterations": clean_iterations, **settings}
        if scheme == "secure_gs":
            settings["max_anchors"] = case.rows // 3
        else:
            settings["max_gaussians"] = case.rows
        public, _ = hide(find_scheme(scheme), pair, seed=case.number, **settings)
    with filling(place) as out:
        attacks = ATTACKS | FORMATS if case.other else ATTACKS
        if case.other and len(public.model) > ATTACKED_ROWS:
            attacks = {name: attacks[name] for name in LARGE_FILES}
        for name, attacked in attack_all(public, pair.scene.views, case.number, attacks):
            attacked.write(out / name / "point_cloud.ply")


def stopped(pair: Pair, other: Other, seed: int) -> PublicModel:
    """Return a model of the pair's scene at one iteration of a longer schedule."""
    capture = pair.scene
    begin = pair.initial_gaussians(other.rows, seed)
    begin = replace(begin, sh_coeffs=begin.sh_coeffs[:, : (other.sh_degree + 1) ** 2].copy())
    start = beginning(begin, seed)
    model = TrainableModel(start.state)
    schedule = replace(Schedule.scaled(other.schedule), sh_every=other.stop // (other.sh_degree + 1) + 1)
    extent = capture.dataset.extent
    trainer = Trainer(model, capture.views, capture.images, schedule, start, extent=extent, max_gaussians=other.rows)
    for _ in islice(trainer, other.stop):
        pass
    return PublicModel(as_gaussians(model.state().parameters))


def attack_all(
    public: PublicModel, views: Sequence[Camera], seed: int, attacks: Mapping[str, tuple[str, dict[str, Any]]]
) -> Iterator[tuple[str, PublicModel]]:
    """Yield the attacked models by name; GOF only for a few small models, since meshes take long."""
    known = Measurements()
    if "gspure" in attacks:
        decision = purify(public, views)
        surface = None
        if public.rows_are_gaussians and public.visible and len(public.model) <= GOF_ROWS and seed in range(0, 10, 2):
            smooth = smoothed(public.model, views)
            surface = mesh_distances(smooth, extract_mesh(smooth, views))
        opacities = public.opacities(views)
        known = Measurements(decision.weights, decision.prune_mask, opacities, surface, decision.labels)
    for name, (attack, settings) in attacks.items():
        if name == "gof" and known.surface is None:
            continue
        try:
            attacked = find_attack(attack).apply(public, known, seed=seed, cameras=views, **settings)
        except NotApplicable:
            continue
        yield name, public.with_model(attacked.model)


def measured(file: Path, family: str, scene: str, views: Sequence[Camera] = ()) -> Row:
    """Return the statistics of one file with six digits; NaN if a statistic cannot be measured."""
    model = read_model(file)
    verdict = judge(model).word if family == FOUND else ""
    values: dict[str, float] = {}
    if model.has_anchors or model.sh_degree < 0:
        verdict = judge(model).word  # by its columns
    else:
        weights = accumulate(map(PublicModel(model).contributions(), views), len(model)) if views else None
        values = measure(model, weights).values
    size = {"rows": len(model), "sh_degree": model.sh_degree}
    numbers = size | likeness(model) | dict.fromkeys((s.name for s in STATISTICS), np.nan) | values
    names = {"family": family, "model": file.parent.parent.name, "scene": scene, "attack": file.parent.name}
    return names | {"verdict": verdict} | {name: float(f"{value:.6g}") for name, value in numbers.items()}


def committed() -> dict[str, list[Row]]:
    """Return the committed rows by model.

    Those of clean models below 50 except 26 and 42, KeySS, hardened and encrypted models are of an earlier version: the
    median opacity is that of all rows, and bits include colours of untrained points.
    """
    with MODELS.open(encoding="utf-8", newline="") as stream:
        lines = list(csv.DictReader(stream))
    rows = [{name: value if name in NAMES else float(value or "nan") for name, value in line.items()} for line in lines]
    return grouped(rows, lambda row: row["model"])


def flagged_in(row: Row, limits: Mapping[str, float], *, weights: bool) -> list[str]:
    """Return the names of the row's statistics beyond their thresholds, with or without those of the weights."""
    return flagged({s.name: row[s.name] for s in STATISTICS if weights or not s.of_weights}, limits)


def thresholds(clean: Sequence[Row]) -> dict[str, float]:
    """Return thresholds at one rank of every statistic: the highest at which at most `RATE` of files are flagged."""
    known = {s: [row[s.name] for row in clean if not np.isnan(row[s.name])] for s in STATISTICS}
    orders = {s.name: sorted(values, reverse=s.raised) for s, values in known.items()}
    chosen: dict[str, float] = {}
    for rank in range(len(clean)):
        limits = {name: order[min(rank, len(order) - 1)] for name, order in orders.items()}
        if sum(bool(flagged_in(row, limits, weights=True)) for row in clean) > RATE * len(clean):
            break
        chosen = limits
    return chosen


def score(row: Row, clean: Sequence[Row]) -> float:
    """Return minus the least share of clean files that are as extreme, over statistics that need no cameras."""
    shares = [1.0]
    for s in STATISTICS:
        value = row[s.name]
        clean_values = np.array([clean_row[s.name] for clean_row in clean])
        if not (np.isnan(value) or s.of_weights):
            beyond = clean_values >= value if s.raised else clean_values <= value
            shares.append((1 + int(beyond.sum())) / (1 + len(clean)))
    return -min(shares)


def rates(rows: Sequence[Row]) -> Iterator[list[Any]]:
    """Yield the table of `RATES`: detection after each attack, by thresholds from clean models of other scenes."""
    clean = [row for row in rows if row["family"] == CLEAN]
    references = {scene: [row for row in clean if row["scene"] != scene] for scene in {row["scene"] for row in rows}}
    limits = {scene: thresholds(reference) for scene, reference in references.items()}
    groups = grouped(rows, lambda row: (row["family"], row["attack"]))
    for (family, attack), group in sorted(groups.items(), key=lambda item: FAMILIES.index(item[0][0])):
        by_file = [
            ["columns"] if row["verdict"] == LIKELY else flagged_in(row, limits[row["scene"]], weights=False)
            for row in group
        ]
        with_cameras = [
            names or flagged_in(row, limits[row["scene"]], weights=True)
            for names, row in zip(by_file, group, strict=True)
        ]
        detected = sum(map(bool, by_file))
        auc: tuple[float, ...] = (np.nan, np.nan, np.nan)
        if family != CLEAN and not any(row["verdict"] for row in group):
            clean_group = [row for row in clean if row["attack"] == attack]
            scores = [score(row, references[row["scene"]]) for row in group]
            clean_scores = [score(row, references[row["scene"]]) for row in clean_group]
            auc = detectability(scores, clean_scores)[:3]
        low, high = binomtest(detected, len(group)).proportion_ci(method="wilson")
        numbers = ["" if np.isnan(number) else f"{number:.2f}" for number in (low, high, *auc)]
        most = most_frequent(name for names in by_file for name in names)
        yield [family, attack, len(group), detected, *numbers[:2], sum(map(bool, with_cameras)), *numbers[2:], most]


def most_frequent(names: Iterable[str]) -> str:
    """Return the most frequent name and its count as text; nothing if there are no names."""
    return "".join(f"{name} {count}" for name, count in Counter(names).most_common(1))


def calibrate(rows: Sequence[Row]) -> Iterator[Clean]:
    """Yield the committed calibration."""
    clean = [row for row in rows if row["family"] == CLEAN]
    limits = thresholds(clean)
    models = len({row["model"] for row in clean})
    for name in (*limits, *LIKENESS):
        values = [row[name] for row in clean if not np.isnan(row[name])]
        quantiles = np.quantile(values, [0, 0.5, 1] if name in LIKENESS else [0.01, 0.5, 0.99])
        low, median, high = (float(f"{quantile:.6g}") for quantile in quantiles)
        yield Clean(name, low, median, high, limits.get(name, np.nan), len(values), models)


def tabulate(folder: Path, found_files: Sequence[str]) -> None:
    """Measure the stored models and files from elsewhere, and write all tables."""
    known = committed()
    rows = []
    for case in cases():
        name = f"{case.family}-{case.number:02d}"
        files = sorted((folder / name).glob("*/*.ply"))
        if not files:
            rows += known.get(name, [])
            continue
        views = split(read_cameras(traced(case, folder) / "cameras.json"))[0]
        rows += [measured(file, case.family, PAIRS[case.pair].split()[0], views) for file in files]
    write_text(HERE / "tables" / "scan.csv", csv_text(RATES, rates(rows)))
    write_table(TABLE, Clean, calibrate(rows))
    found = [measured(Path(name), FOUND, Path(name).stem) for name in found_files]
    rows += found or [row for group in known.values() for row in group if row["family"] == FOUND]
    cells = ([str(value).replace("nan", "").removesuffix(".0") for value in row.values()] for row in rows)
    write_text(MODELS, csv_text(rows[0], cells))


if __name__ == "__main__":
    if sys.argv[1] == "models":
        for case in cases():
            build(case, Path(sys.argv[2]))
    else:
        tabulate(Path(sys.argv[2]), sys.argv[3:])
