"""What further attacks leave of a hidden scene, from the results of ``gspure audit experiments/arsenal.yaml``.

``python -m experiments.arsenal RESULTS`` writes tables/arsenal.csv: for each attack the damage, dB, and what an owner
reads, as published and after adapting. z compares the trace with candidates alone; the word counts clean models and
twins, too.
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from experiments.free_attacks import OWNERS, READING, reading
from gspure.evaluation.collecting import collect
from gspure.evaluation.judging import judged
from gspure.evaluation.plan import read_plan
from gspure.files import write_text
from gspure.metrics.csv_tables import csv_text

TABLE = Path(__file__).resolve().parent / "tables" / "arsenal.csv"
COLUMNS = ("scheme", "scene", "attack", "damage")


def table(results: Path) -> Iterator[Sequence[str]]:
    """Yield the rows of the table."""
    plan = read_plan(results)
    outcomes = collect(results, plan.models)
    rows = {(row.model, row.variant, row.extraction): row for row in judged(outcomes, plan.attacks)}
    for outcome in outcomes:
        if outcome.is_control or outcome.failure:
            continue
        cells = [outcome.scheme, outcome.scene, outcome.variant, f"{round(outcome.damage, 2) + 0.0:.2f}"]
        for extraction in OWNERS.values():
            cells += reading(outcome, rows[outcome.model, outcome.variant, extraction])
        yield cells


def main() -> None:
    columns = [*COLUMNS, *(f"{owner}_{name}" for owner in OWNERS for name in READING)]
    write_text(TABLE, csv_text(columns, table(Path(sys.argv[1]))))


if __name__ == "__main__":
    main()
