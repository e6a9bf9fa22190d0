"""Print a table over all scenes of several runs: GSPure's lead over the best other attack, or every attack's effect.

python -m benchmarks.leads leads docs/results/large/*.csv > docs/tables/large-leads.csv
python -m benchmarks.leads attacks docs/results/large/*.csv > docs/tables/large-attacks.csv

Each file is the ``results.csv`` of a run; the scenes of different runs have different names.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from gspure.evaluation.contest import Lead, leads
from gspure.evaluation.results import read_results
from gspure.evaluation.survival import Survival, survival
from gspure.grouping import grouped
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.names import display_name, extraction_name
from gspure.report.table import interval
from gspure.report.tables import number_format
from gspure.text import decimal

LEADS = ("condition", "extraction", "at most, dB", "against", "best other attack", "lead", "scenes")
DROPS = ("scene drop", "message drop", "above controls", "oracle drop", "oracle above controls", "RMS ratio", "scenes")


def of_lead(row: Lead) -> list[str]:
    """Return a lead as text; `≤` marks an upper bound."""
    lead = interval(row.difference, row.difference.scenes, number_format(row.extraction))
    return [
        row.condition.title,
        extraction_name(row.extraction),
        f"{row.damage:g}",
        row.against,
        display_name(row.attack),
        f"≤ {lead}" if row.is_bound else lead,
        f"{row.difference.scenes}",
    ]


def of_attack(rows: Sequence[Survival]) -> list[str]:
    """Return the effect of an attack on the scene, and on the message for the owner and for an oracle."""
    scenes = max(row.scenes for row in rows)
    scene_drop = interval(rows[0].scene_drop, scenes)
    message_drops = [interval(drop, scenes) for row in rows for drop in (row.message_drop, row.above_floor)]
    without_oracle = ["–"] * (len(DROPS) - 3 - len(message_drops))
    ratios = " / ".join(decimal(row.rms_ratio) for row in rows)
    return [rows[0].name, str(scene_drop), *map(str, message_drops), *without_oracle, ratios, f"{scenes}"]


if __name__ == "__main__":
    outcomes, attacks = read_results(*map(Path, sys.argv[2:]))
    if sys.argv[1] == "leads":
        sys.stdout.write(csv_text(LEADS, map(of_lead, leads(outcomes, attacks))))
    else:
        by_attack = grouped(survival(outcomes), lambda row: (row.condition.title, row.variant))
        rows = [[condition, *of_attack(alike)] for (condition, _), alike in by_attack.items()]
        sys.stdout.write(csv_text(("condition", "attack", *DROPS), rows))
