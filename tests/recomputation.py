"""Every number of the tables of a run, recomputed from its images and arrays alone.

Nothing here is imported from the package: sums are written out, and files are read by numpy and PIL.
"""

import csv
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

CONTROLS = ("clean", "wrong_key", "other_scene", "black", "mean_colour")
WITHOUT_MESSAGE = ("clean", "other_scene", "black", "mean_colour")
METRICS = ("psnr", "ssim", "region", "ms_ssim", "nc", "structure")
Cells = dict[tuple[str, str], float]  # by scene and repetition


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def number(text: str) -> float:
    return float(text) if text else math.nan


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), np.float64) / 255


def metrics(a: np.ndarray, b: np.ndarray) -> dict[str, float]:
    """The metrics of two images [H,W,3] whose shorter side is below 22 pixels, or a multiple of two scales."""
    colours, counts = np.unique(np.rint(255 * a).reshape(-1, 3), axis=0, return_counts=True)
    region = (np.rint(255 * a) != colours[counts.argmax()]).any(axis=2)
    gradients = [np.concatenate([np.diff(x, axis=0).ravel(), np.diff(x, axis=1).ravel()]) for x in (a, b)]
    luminance, contrast = similarity(a, b)
    return {
        "psnr": decibels(a, b),
        "ssim": float((luminance * contrast).mean()),
        "region": decibels(a[region], b[region]) if region.any() else decibels(a, b),
        "ms_ssim": multiscale(a, b),
        "nc": correlation(*((x - x.mean(axis=(0, 1))).ravel() for x in (a, b))),
        "structure": correlation(*gradients),
    }


def decibels(a: np.ndarray, b: np.ndarray) -> float:
    error = ((a - b) ** 2).mean()
    return 10 * math.log10(1 / error) if error else math.inf


def correlation(x: np.ndarray, y: np.ndarray) -> float:
    norm = math.sqrt((x @ x) * (y @ y))
    return float(x @ y) / norm if norm else 0.0


def blurred(x: np.ndarray) -> np.ndarray:
    weights = np.exp(-(np.arange(-5, 6) ** 2) / (2 * 1.5**2))
    window = np.outer(weights, weights) / weights.sum() ** 2
    height, width = x.shape[:2]
    padded = np.pad(x, ((5, 5), (5, 5), (0, 0)))
    return sum(window[i, j] * padded[i : i + height, j : j + width] for i, j in product(range(11), repeat=2))


def similarity(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mean_a, mean_b = blurred(a), blurred(b)
    var_a, var_b = blurred(a * a) - mean_a**2, blurred(b * b) - mean_b**2
    luminance = (2 * mean_a * mean_b + 0.01**2) / (mean_a**2 + mean_b**2 + 0.01**2)
    return luminance, (2 * (blurred(a * b) - mean_a * mean_b) + 0.03**2) / (var_a + var_b + 0.03**2)


def multiscale(a: np.ndarray, b: np.ndarray) -> float:
    weights = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)[: int(math.log2(max(min(a.shape[:2]) / 11, 1))) + 1]
    index = np.ones(3)
    for scale, weight in enumerate(weights):
        if scale:
            a, b = (x[: x.shape[0] // 2 * 2, : x.shape[1] // 2 * 2] for x in (a, b))
            a, b = ((x[::2, ::2] + x[1::2, ::2] + x[::2, 1::2] + x[1::2, 1::2]) / 4 for x in (a, b))
        luminance, contrast = (x[5:-5, 5:-5] for x in similarity(a, b))
        terms = luminance * contrast if scale == len(weights) - 1 else contrast
        index *= np.maximum(terms.mean(axis=(0, 1)), 0) ** (weight / sum(weights))
    return float(index.mean())


class Results:
    """The folder ``results`` of a workflow, with the path to the photographs of its pairs."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rows = [row for row in table(folder / "tables" / "results.csv") if row["reference"] == "truth"]
        self.conditions = list(dict.fromkeys(map(condition, self.rows)))

    def read(self, name: str) -> list[dict[str, str]]:
        """The rows of a table that are about pictures of messages compared with photographs."""
        shown = {(*condition(row), row["target"]) for row in self.rows}
        return [row for row in table(self.folder / "tables" / name) if (*condition(row), row["extraction"]) in shown]

    def of(self, row: Mapping[str, str]) -> Path:
        scene = row["scene"] + (f"@{row['seed']}" if row["seed"] != "0" else "")
        return self.folder / row["scheme"] / scene / row["variant"]

    def images(self, row: Mapping[str, str]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """By view, the photograph of a row of the table and what is compared with it."""
        truth = self.folder / "pairs" / row["scene"] / row["target"].partition("_")[0]
        if row["variant"] in ("black", "mean_colour"):
            shown = self.of({**row, "variant": "unattacked"}) / "renders" / row["target"]
        else:
            shown = self.of(row) / "renders" / row["target"]
        known = {}
        for file in sorted(shown.glob("*.png")):
            photograph = pixels(truth / file.name)
            flat = {
                "black": 0 * photograph,
                "mean_colour": np.broadcast_to(photograph.mean(axis=(0, 1)), photograph.shape),
            }
            known[file.stem] = photograph, flat[row["variant"]] if row["variant"] in flat else pixels(file)
        return known

    def cells(self, chosen: tuple[str, ...], variant: str, target: str, column: str = "psnr") -> Cells:
        return {
            (row["scene"], row["seed"]): number(row[column])
            for row in self.rows
            if condition(row) == chosen and (row["variant"], row["target"]) == (variant, target)
        }

    def highest(self, chosen: tuple[str, ...], target: str, column: str = "psnr") -> Cells:
        highest: Cells = {}
        for control in WITHOUT_MESSAGE:
            for cell, value in self.cells(chosen, control, target, column).items():
                highest[cell] = max(value, highest.get(cell, -math.inf))
        return highest


def condition(row: Mapping[str, str]) -> tuple[str, ...]:
    return row["scheme"], row["protocol"], row["initialization"]


def model(row: Mapping[str, str]) -> tuple[str, ...]:
    return *condition(row), row["scene"], row["seed"]


def drops(before: Cells, after: Cells) -> Cells:
    return {cell: before[cell] - after[cell] for cell in before.keys() & after.keys()}


def over_scenes(cells: Cells) -> list[float]:
    """The means over repetitions of every scene."""
    scenes = defaultdict(list)
    for (scene, _), value in sorted(cells.items()):
        scenes[scene].append(value)
    return [float(np.mean(values)) for values in scenes.values()]


def interval(values: Sequence[float], name: str) -> dict[str, float]:
    """The columns of a mean over fewer than six scenes."""
    if not values:
        return dict.fromkeys((f"{name}_{part}" for part in ("mean", "low", "high", "level", "scenes")), math.nan)
    level = 1 - 2.0 ** (1 - len(values))
    numbers = {"mean": np.mean(values), "low": min(values), "high": max(values), "level": level, "scenes": len(values)}
    return {f"{name}_{part}": float(value) for part, value in numbers.items()}


def compare(row: Mapping[str, str], expected: Mapping[str, float], where: str) -> int:
    """Compare columns of a row; return their number."""
    for column, value in expected.items():
        np.testing.assert_allclose(number(row[column]), value, rtol=1e-5, atol=5e-5, err_msg=f"{where}: {column}")
    return len(expected)


def check_metrics(results: Results) -> int:
    """Check ``metrics.csv`` of every variant, from the images; return how many numbers were compared."""
    count = 0
    for row in results.rows:
        written = {(r["target"], r["view"]): r for r in table(results.of(row) / "metrics.csv")}
        for view, pair in results.images(row).items():
            count += compare(written[row["target"], view], metrics(*pair), f"{results.of(row)} {view}")
    return count


def check_results(results: Results) -> int:
    """Check ``results.csv``: means over views, drops, Scores and shares, from the images and masks."""
    count = 0
    known: dict[Any, dict[str, float]] = {}
    measured = [(row, {view: metrics(*pair) for view, pair in results.images(row).items()}) for row in results.rows]
    equal = defaultdict(set)  # views that a variant shows exactly; they are in no mean of their model
    for row, views in measured:
        equal[model(row), row["target"]] |= {view for view, numbers in views.items() if numbers["psnr"] == math.inf}
    for row, views in measured:
        cell = (*model(row), row["variant"], row["target"])
        counted = [numbers for view, numbers in views.items() if view not in equal[model(row), row["target"]]]
        known[cell] = {name: float(np.mean([view[name] for view in counted])) for name in METRICS}
        count += compare(row, {**known[cell], "views": len(counted)}, f"{cell}")
    for row in results.rows:
        place = model(row)
        after, before = (known.get((*place, variant, row["target"])) for variant in (row["variant"], "unattacked"))
        if before and after:
            count += compare(row, {f"{name}_drop": before[name] - after[name] for name in METRICS}, f"{place}")
        if row["variant"] not in CONTROLS:
            message = row["target"] if row["target"] != "scene" else "message"
            lost = [
                known[*place, "unattacked", t]["psnr"] - known[*place, row["variant"], t]["psnr"]
                for t in (message, "scene")
            ]
            count += compare(row, {"score": lost[0] - lost[1]}, f"{place} {row['variant']}")
        if (mask := results.of(row) / "prune_mask.npy").is_file():
            pruned = np.load(mask)
            expected = {"pruned_share": pruned.sum() / len(pruned)}
            if (key := results.of(row).parent / "key" / "message_rows.npy").is_file():
                truth = np.load(key)
                hits = (pruned & truth).sum()
                expected |= {
                    "precision": hits / pruned.sum() if pruned.any() else math.nan,
                    "recall": hits / truth.sum(),
                }
            count += compare(row, expected, f"{place} {row['variant']}")
    return count


def check_summary(results: Results) -> int:
    """Check ``summary.csv``, from ``results.csv``."""
    count = 0
    for row in results.read("summary.csv"):
        expected: dict[str, float] = {}
        for name, target, column in (
            ("scene", "scene", "psnr"),
            ("message", row["extraction"], "psnr"),
            ("score", row["extraction"], "score"),
            ("retrieved", row["extraction"], "retrieval_top1"),
        ):
            cells = results.cells(condition(row), row["variant"], target, column)
            known = {cell: value for cell, value in cells.items() if math.isfinite(value)}
            expected |= interval(over_scenes(known), name)
        count += compare(row, expected, f"{row['variant']}")
    return count


def check_survival(results: Results) -> int:
    """Check ``survival.csv``: who survives where, drops, margins, shares, RMS ratio and AUC, from ``results.csv``."""
    count = 0
    for row in results.read("survival.csv"):
        chosen, variant, extraction = condition(row), row["variant"], row["extraction"]
        highest = results.highest(chosen, extraction)
        before, after = (results.cells(chosen, name, extraction) for name in ("unattacked", variant))
        present = _present(results, chosen, "unattacked", extraction, before, highest)
        by_psnr = _above(after, highest)
        survived = present & by_psnr
        after = {cell: value for cell, value in after.items() if cell[0] in present or not present}
        before = {cell: value for cell, value in before.items() if cell in after}
        scene_before, scene_after = (results.cells(chosen, name, "scene") for name in ("unattacked", variant))
        scenes = {cell: value for cell, value in scene_after.items() if cell in after}
        free = set.union(*(_retrieved(results, chosen, name, extraction) for name in ("clean", "other_scene")))
        only = (present - survived) & _retrieved(results, chosen, variant, extraction) - free
        above, whole = (over_scenes(drops(level, highest)) for level in (after, before))
        expected = {
            "present": len(present & {scene for scene, _ in after}),
            "survived": len(survived),
            "only_retrieved": len(only),
        }
        expected |= interval(over_scenes(drops(before, after)), "message_drop")
        expected |= interval(over_scenes(drops(scene_before, scenes)), "scene_drop")
        expected |= interval(above, "above_floor")
        shares = [max(0.0, a) / b for a, b in zip(above, whole, strict=True) if b > 0] if present else []
        expected |= interval(shares, "share_left")
        wrong = results.cells(chosen, "wrong_key", extraction)
        expected |= interval(over_scenes(drops(after, wrong)), "above_wrong_key")
        expected["rms_ratio"] = _rms_ratio([before, after], [scene_before, scenes])
        attacked, aucs = over_scenes(after), {}
        for kind in ("clean", "other_scene"):
            if controls := over_scenes(results.cells(chosen, kind, extraction)):
                aucs[kind] = float(np.mean([(a > c) + 0.5 * (a == c) for a, c in product(attacked, controls)]))
        if aucs:
            expected["detectability_auc"] = min(aucs.values())
        count += compare(row, expected, f"{variant}")
    return count


def _above(level: Cells, highest: Cells) -> set[str]:
    scenes = sorted({scene for scene, _ in level.keys() & highest.keys()})
    return {scene for scene, margin in zip(scenes, over_scenes(drops(level, highest)), strict=True) if margin >= 1}


def _present(results: Results, chosen: Any, variant: str, target: str, level: Cells, highest: Cells) -> set[str]:
    measured = {
        cell[0] for cell, value in results.cells(chosen, variant, target, "retrieval_top1").items() if value == value
    }
    return _above(level, highest) - (measured - _retrieved(results, chosen, variant, target))


def _retrieved(results: Results, chosen: Any, variant: str, target: str) -> set[str]:
    columns = [results.cells(chosen, variant, target, f"retrieval_{name}") for name in ("top1", "views", "candidates")]
    retrieved = set()
    for cell, top1 in columns[0].items():
        if math.isfinite(top1):
            n, chance = int(columns[1][cell]), 1 / columns[2][cell]
            at_least = range(round(top1 * n), n + 1)
            if sum(math.comb(n, k) * chance**k * (1 - chance) ** (n - k) for k in at_least) <= 0.05:
                retrieved.add(cell[0])
    return retrieved


def _rms_ratio(message: Sequence[Cells], scene: Sequence[Cells]) -> float:
    known = set.intersection(*({*cells} for cells in (*message, *scene)))
    rises = []
    for levels in (message, scene):
        means = [over_scenes({cell: cells[cell] for cell in known}) for cells in levels]
        rises.append(sum(10 ** (-b / 10) - 10 ** (-a / 10) for a, b in zip(*means, strict=True)))
    return math.sqrt(max(rises[0], 0) / rises[1]) if rises[1] > 0 else math.nan


def check_contest(results: Results) -> int:
    """Check ``contest.csv``: GSPure minus other attacks as they were run, with p and its correction."""
    rows = [row for row in results.read("contest.csv") if not row["damage"]]
    count, tests = 0, defaultdict(list)
    for row in rows:
        chosen, columns = (
            condition(row),
            {"score": row["extraction"], "message_drop": row["extraction"], "scene_drop": "scene"},
        )
        column = "score" if row["quantity"] == "score" else "psnr_drop"
        values = [results.cells(chosen, name, columns[row["quantity"]], column) for name in ("gspure", row["attack"])]
        means = over_scenes(drops(*values))
        count += compare(row, interval(means, "difference"), f"{row['attack']} {row['quantity']}")
        if row["quantity"] == "score":
            signs = np.array([*product((-1, 1), repeat=len(means))]) @ means
            p = float(np.mean(np.abs(signs) >= abs(sum(means)) * (1 - 1e-12)))
            count += compare(row, {"p": p}, row["attack"])
            tests[*chosen, row["extraction"]].append((p, row))
    for family in tests.values():
        largest = 0.0
        for rank, (p, row) in enumerate(sorted(family, key=lambda test: test[0])):
            largest = max(largest, min(1.0, (len(family) - rank) * p))
            count += compare(row, {"p_adjusted": largest}, row["attack"])
    return count


def check_searched(results: Results) -> int:
    """Check the rows of ``matched.csv`` whose strength was searched for their damage."""
    count = 0
    for row in results.read("matched.csv"):
        variant = f"{row['sweep']}@{number(row['damage']):g}dB"
        cells = results.cells(condition(row), variant, row["extraction"], "psnr_drop")
        if cells:
            count += compare(row, interval(over_scenes(cells), "drop"), variant)
    return count


CHECKS: Iterable[Any] = (
    check_metrics,
    check_results,
    check_summary,
    check_survival,
    check_contest,
    check_searched,
)
