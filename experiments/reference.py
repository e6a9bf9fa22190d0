"""The reference run: one configuration, reference/configuration.yaml, of audits of many scenes and schemes.

``python -m experiments.reference OUT PHOTOGRAPHS [PART ...]`` runs each part in OUT/PART; a killed run continues. It
writes what it measured to results/reference/PART.csv, all cells of scenes, schemes and owners to
tables/reference-cells.csv, and the paired comparisons to tables/reference-comparisons.csv.
"""

import csv
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Final

import yaml

from experiments.paired_tests import holm, paired_test
from gspure.evaluation.radius import ModelRadius, model_radii, radius_text
from gspure.evaluation.results import ADAPTS, PUBLISHED, Result, read_results, write_results
from gspure.files import write_text
from gspure.grouping import grouped
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.names import UNATTACKED
from gspure.metrics.statistics import by_scene, differences, mean_interval
from gspure.text import decimal, p_value

HERE: Final = Path(__file__).parent
CONFIGURATION: Final = HERE / "reference" / "configuration.yaml"
RESULTS: Final = HERE / "results" / "reference"
TABLES: Final = HERE / "tables"
OWNERS: Final = (PUBLISHED, ADAPTS)
CELLS: Final = ("part", "scheme", "scene", "seed", "owner", "radius", "killer", "missing", "CPU hours")
COMPARED: Final = ("part", "scheme", "protocol", "scenes", "difference, low, high (dB)", "p", "p by Holm")


def run(name: str, configuration: Mapping[str, Any], folder: Path, photographs: Path) -> None:
    """Run a part in its folder, or what is left of it."""
    folder.mkdir(parents=True, exist_ok=True)
    photos = folder / "photos"
    if photographs.is_dir() and not photos.exists():
        photos.symlink_to(photographs.resolve())
    write_text(folder / f"{name}.yaml", yaml.safe_dump(dict(configuration), sort_keys=False))
    command = [sys.executable, "-m", "gspure", "audit", f"{name}.yaml"]
    paths = os.pathsep.join([str(HERE.parent), os.environ.get("PYTHONPATH", "")])
    subprocess.run(command, cwd=folder, env=os.environ | {"PYTHONPATH": paths}, check=False)  # failures are cells


def measured(folder: Path) -> list[Result]:
    """Return the results of a part, so far."""
    table = folder / "results" / "tables" / "results.csv"
    return read_results(table) if table.is_file() else []


def cells(name: str, folder: Path, rows: Sequence[Result]) -> Iterator[list[str]]:
    """Yield the radius of each model and owner, or why it is missing."""
    radii = {(one.model, one.owner): one for one in model_radii(rows) if one.kind == "message"}
    for model, alike in grouped(rows, lambda row: row.model).items():
        hours = cpu_hours(folder / "results" / "benchmarks" / model.scheme / model.folder_name)
        for owner in OWNERS:
            of_owner = [row for row in alike if row.owner == owner]
            radius = radii.get((model, owner))
            found = ["", "", reason(of_owner)] if radius is None else [*text_of(radius), ""]
            yield [name, model.scheme, model.scene, str(model.seed), owner, *found, decimal(hours, 2)]


def text_of(radius: ModelRadius) -> list[str]:
    """Return a radius and its killer."""
    return [radius_text(radius.radius, exceeds=radius.exceeds), radius.killer]


def reason(rows: Sequence[Result]) -> str:
    """Return why an owner has no radius."""
    failures = [row.failure for row in rows if row.failure]
    if failures:
        return failures[0]
    before = [row for row in rows if row.variant == UNATTACKED]
    return f"not proven before attacks: p {p_value(before[0].p)}" if before else "no extraction for this owner"


def cpu_hours(folder: Path) -> float:
    """Return the processor time of the jobs below a folder of benchmarks."""
    seconds = 0.0
    for file in folder.rglob("*.tsv"):
        with file.open(newline="", encoding="utf-8") as stream:
            seconds += sum(float(row["cpu_time"]) for row in csv.DictReader(stream, delimiter="\t"))
    return seconds / 3600


def ends(rows: Sequence[Result], attack: str) -> dict[tuple[str, int], float]:
    """Return the least damage at which an attack ends the message, by scene and seed, for the owner who adapts."""
    ended = [row for row in rows if row.attack == attack and row.owner == ADAPTS and row.word and not row.is_proven]
    least = {}
    for cell, alike in grouped(ended, lambda row: (row.scene, row.seed)).items():
        damages = [max(0.0, row.damage) for row in alike if isfinite(row.damage)]
        if damages:
            least[cell] = min(damages)
    return least


def compared(plan: Mapping[str, Any], results: Mapping[str, Sequence[Result]]) -> Iterator[list[str]]:
    """Yield the planned comparisons, over the scenes in which both attacks end the message."""
    ours, other = plan["attacks"]
    by_comparison = []
    for one in plan["of"]:
        chosen = [row for row in results.get(one["part"], ()) if row.condition.scheme == one["scheme"]]
        chosen = [row for row in chosen if row.condition.protocol == one["protocol"]]
        by_comparison.append(by_scene(differences(ends(chosen, ours), ends(chosen, other))))
    p = [paired_test(scenes) if scenes else 1.0 for scenes in by_comparison]
    for one, scenes, single, corrected in zip(plan["of"], by_comparison, p, holm(p), strict=True):
        numbers = ["", "", ""]
        if scenes:
            mean = mean_interval(scenes)
            levels = ", ".join(decimal(level, 2) for level in (mean.mean, mean.low, mean.high))
            numbers = [levels, p_value(single), p_value(float(corrected))]
        yield [one["part"], one["scheme"], one["protocol"], str(len(scenes)), *numbers]


def main(out: Path, photographs: Path, *names: str) -> None:
    """Run parts, by default all, and write what all parts measured so far."""
    plan = yaml.safe_load(CONFIGURATION.read_text(encoding="utf-8"))
    results = {}
    lines: list[list[str]] = []
    for name in names or plan["parts"]:
        run(name, plan["parts"][name], out / name, photographs)
    for name in plan["parts"]:
        results[name] = measured(out / name)
        if not results[name]:
            continue
        write_results(RESULTS / f"{name}.csv", results[name])
        lines += cells(name, out / name, results[name])
    write_text(TABLES / "reference-cells.csv", csv_text(CELLS, lines))
    write_text(TABLES / "reference-comparisons.csv", csv_text(COMPARED, compared(plan["comparisons"], results)))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
