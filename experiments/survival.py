"""Keyed patterns of an audit under attacks that no suite has: tables/survival.csv.

gspure audit experiments/survival.yaml
python -m experiments.survival results
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from experiments.keyed_pattern import COLUMNS, TABLES, Result, Trial, colluding, embedding_row, judged
from gspure.files import write_text
from gspure.metrics.csv_tables import csv_text
from gspure.model import read_model
from gspure.public_model import PublicModel
from gspure.schemes.keyed_pattern.key import KeyedPatternKey
from gspure.schemes.pair import read_pair

SCHEME = "keyed_pattern"
ERASURES = ((0.006, 1), (0.01, 1), (0.015, 2), (0.02, 3), (0.03, 4))  # clip and passes of `unmark`
DISTILLATION = 1500


def erasing(trial: Trial, folder: Path) -> Iterator[Result]:
    """Yield the results of erasing the mark, and of new rows, moved or of an erased model."""
    for clip, passes in ERASURES:
        yield "unmark", f"clip={clip} passes={passes}", trial.attacked("unmark", clip=clip, passes=passes)
    distilled = read_model(folder / "distil" / "public")
    turned = trial.attacked("rigid_transform", distilled, angle=30.0, scale=1.1, translation="0.3,0,0.2")
    yield "distil, rigid_transform", f"{DISTILLATION} steps", turned
    smoothed = trial.attacked("unmark", clip=0.015, passes=2).model
    again = trial.attacked("distil", smoothed, iterations=DISTILLATION)
    yield "unmark, distil", f"clip=0.015 passes=2, {DISTILLATION} steps", again


def rows(results: Path) -> Iterator[list[str]]:
    """Yield the rows of all scenes of an audit."""
    for folder in sorted(path for path in (results / SCHEME).iterdir() if (path / "key").is_dir()):
        pair = read_pair(results / "pairs" / folder.name)
        trial = Trial(pair, PublicModel.read(folder / "public"), KeyedPatternKey.read(folder / "key"))
        print(folder.name, flush=True)
        yield [folder.name, *embedding_row(trial)]
        for attack_results in (erasing(trial, folder), colluding(trial)):
            for row in judged(trial, attack_results):
                yield [folder.name, *row]


if __name__ == "__main__":
    write_text(TABLES / "survival.csv", csv_text(("scene", *COLUMNS), rows(Path(sys.argv[1]))))
