"""Every number of the tables over scenes, recomputed from ``results.csv`` with sums written out.

Nothing here is imported from the package.
"""

import csv
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

WITHOUT_MESSAGE = ("clean", "other_scene", "black", "mean_colour")
Cells = dict[tuple[str, str], float]  # by scene and repetition


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def number(text: str) -> float:
    return float(text) if text else math.nan


class Results:
    """The folder ``results`` of a run."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rows = [row for row in table(folder / "tables" / "results.csv") if row["reference"] == "truth"]
        self.conditions = list(dict.fromkeys(map(condition, self.rows)))

    def read(self, name: str) -> list[dict[str, str]]:
        """The rows of a table that are about pictures of messages compared with photographs."""
        shown = {(*condition(row), row["target"]) for row in self.rows}
        return [row for row in table(self.folder / "tables" / name) if (*condition(row), row["extraction"]) in shown]

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


CHECKS: Iterable[Any] = (check_summary, check_survival, check_contest, check_searched)
