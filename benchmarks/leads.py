"""Print a table over all scenes of several runs: GSPure's lead over the best other attack, or what every attack does.

python -m benchmarks.leads leads docs/results/large/*.csv > docs/tables/large-leads.csv
python -m benchmarks.leads attacks docs/results/large/*.csv > docs/tables/large-attacks.csv

Each file is the ``results.csv`` of a run; the scenes of different runs have different names.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from gspure.evaluation.collecting import read_results
from gspure.evaluation.contest import Lead, leads
from gspure.evaluation.survival import Survival, survival
from gspure.grouping import grouped
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.names import display_name, extraction_name
from gspure.report.table import interval
from gspure.report.tables import text_of
from gspure.text import decimal

LEADS = ("condition", "extraction", "at most, dB", "against", "best other attack", "lead", "scenes")
DROPS = ("scene drop", "message drop", "above controls", "oracle drop", "oracle above controls", "RMS ratio", "scenes")


def of_lead(row: Lead) -> list[str]:
    """Return a lead as text; `≤` marks an upper bound."""
    lead = interval(row.difference, row.difference.scenes, text_of(row.extraction))
    names = [row.condition.title, extraction_name(row.extraction), f"{row.damage:g}", row.against]
    return [*names, display_name(row.attack), f"{'≤ ' * row.is_bound}{lead}", f"{row.difference.scenes}"]


def of_attack(rows: Sequence[Survival]) -> list[str]:
    """Return what an attack does to the scene, and to the message as its owner and as an oracle extracts it."""
    scenes = max(row.scenes for row in rows)
    drops = [interval(drop, scenes) for row in rows for drop in (row.message_drop, row.above_floor)]
    drops += ["–"] * (len(DROPS) - 3 - len(drops))  # without an oracle
    ratios = " / ".join(decimal(row.rms_ratio) for row in rows)
    return [rows[0].name, *map(str, (interval(rows[0].scene_drop, scenes), *drops)), ratios, f"{scenes}"]


if __name__ == "__main__":
    outcomes, attacks = read_results(*map(Path, sys.argv[2:]))
    if sys.argv[1] == "leads":
        sys.stdout.write(csv_text(LEADS, map(of_lead, leads(outcomes, attacks))))
    else:
        by_attack = grouped(survival(outcomes), lambda row: (row.condition.title, row.variant))
        rows = [[condition, *of_attack(alike)] for (condition, _), alike in by_attack.items()]
        sys.stdout.write(csv_text(("condition", "attack", *DROPS), rows))
