"""Keyed patterns of an audit under attacks that no suite has: tables/survival.csv.

gspure audit experiments/survival.yaml  # or survival_weaker.yaml
python -m experiments.survival results [SCENE...]

Rows of other scenes stay in the table.
"""

import csv
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from experiments.keyed_pattern import COLUMNS, TABLES, Result, Trial, colluding, embedding_row, judged
from gspure.files import write_text
from gspure.grouping import grouped
from gspure.metrics.csv_tables import csv_text
from gspure.model import read_model
from gspure.public_model import PublicModel
from gspure.schemes.keyed_pattern.key import KeyedPatternKey
from gspure.schemes.pair import read_pair

TABLE = TABLES / "survival.csv"
SCHEME = "keyed_pattern"
ERASURES = ((0.006, 1), (0.01, 1), (0.015, 2), (0.02, 3), (0.03, 4))  # clip and passes of `unmark`
DISTILLATION = 1500


def erasing(trial: Trial, folder: Path) -> Iterator[Result]:
    """Yield the results of `unmark`, of moving the audit's distilled model, and of `unmark`, then `distil`."""
    for clip, passes in ERASURES:
        yield "unmark", f"clip={clip} passes={passes}", trial.attacked("unmark", clip=clip, passes=passes)
    distilled = read_model(folder / "distil" / "public")
    turned = trial.attacked("rigid_transform", distilled, angle=30.0, scale=1.1, translation="0.3,0,0.2")
    yield "distil, rigid_transform", f"{DISTILLATION} steps", turned
    smoothed = trial.attacked("unmark", clip=0.015, passes=2).model
    again = trial.attacked("distil", smoothed, iterations=DISTILLATION)
    yield "unmark, distil", f"clip=0.015 passes=2, {DISTILLATION} steps", again


def rows(folder: Path) -> Iterator[list[str]]:
    """Yield the rows of the scene in a folder of an audit."""
    pair = read_pair(folder.parent.parent / "pairs" / folder.name)
    trial = Trial(pair, PublicModel.read(folder / "public"), KeyedPatternKey.read(folder / "key"))
    yield [folder.name, *embedding_row(trial)]
    for attack_results in (erasing(trial, folder), colluding(trial)):
        for row in judged(trial, attack_results):
            yield [folder.name, *row]


def main(results: Path, scenes: Sequence[str]) -> None:
    """Put the rows of some scenes, by default all, into the table, in place of older ones."""
    folders = sorted(path for path in (results / SCHEME).iterdir() if (path / "key").is_dir())
    known: dict[str, list[list[str]]] = {}
    if TABLE.is_file():
        with TABLE.open(newline="", encoding="utf-8") as file:
            _, *lines = csv.reader(file)
        known = grouped(lines, lambda line: line[0])
    for folder in folders:
        if not scenes or folder.name in scenes:
            known[folder.name] = [*rows(folder)]
    ordered = [line for scene in sorted(known) for line in known[scene]]
    write_text(TABLE, csv_text(("scene", *COLUMNS), ordered))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
