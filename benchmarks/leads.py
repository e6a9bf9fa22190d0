"""Print GSPure's lead over the best other attack as a table, over all scenes of several runs.

python -m benchmarks.leads docs/results/large/*.csv > docs/tables/large-leads.csv

Each file is the ``results.csv`` of a run; the scenes of different runs have different names.
"""

import sys
from pathlib import Path

from gspure.evaluation.collecting import read_results
from gspure.evaluation.contest import Lead, leads
from gspure.evaluation.csv_tables import csv_text
from gspure.evaluation.names import condition_name, display_name, extraction_name
from gspure.report.table import interval
from gspure.report.tables import text_of

COLUMNS = ("condition", "extraction", "at most, dB", "against", "best other attack", "lead", "scenes")


def cells(row: Lead) -> list[str]:
    """Return a row as text; `≤` marks an upper bound."""
    lead = interval(row.difference, row.difference.scenes, text_of(row.extraction))
    names = [condition_name(*row.condition), extraction_name(row.extraction), f"{row.damage:g}", row.against]
    return [*names, display_name(row.attack), f"{'≤ ' * row.is_bound}{lead}", f"{row.difference.scenes}"]


if __name__ == "__main__":
    sys.stdout.write(csv_text(COLUMNS, map(cells, leads(*read_results(*map(Path, sys.argv[1:]))))))
