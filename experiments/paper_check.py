"""The paper's printed numbers against those that follow from its own tables.

``python -m experiments.paper_check [RESULTS]`` prints every check, and the attacks of Table 1 beside those of a
results.csv of ``gspure report``, and writes all checks to tables/paper_check.csv.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from experiments import printed
from gspure.evaluation.results import Result, read_results
from gspure.files import write_text
from gspure.grouping import grouped
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.names import display_name
from gspure.report.table import Cell, Column, Table, TableRow, interval
from gspure.text import UNKNOWN, decimal, signed

TABLE: Final = Path(__file__).parent / "tables" / "paper_check.csv"
BESIDE: Final = (
    "In dB. Paper: mean over the nine scenes of its Table 1, with the Score recomputed from its PSNR. Ours: mean over "
    "our scenes, at our strengths."
)


def main(results: Sequence[Result]) -> None:
    """Write and print every check."""
    rows = printed.read_rows()
    checks = printed.check_claims(rows)
    write_text(TABLE, as_csv(checks))
    title = "Scores in dB, recomputed from Table 1 with the 95% interval over its scenes"
    columns = ["scheme", "attack", "printed", "recomputed", "difference", "follows"]
    of_scores = [check for check in checks if check.claim.quantity == printed.SCORE]
    scores = check_table(title, columns, [score_row(check, rows) for check in of_scores])
    title = "Other numbers in dB, recomputed from Table 1"
    columns = ["place", "printed", "recomputed", "difference", "follows"]
    of_others = [check for check in checks if check.claim.quantity != printed.SCORE]
    others = check_table(title, columns, [number_row(check) for check in of_others])
    for table in (scores, others, beside_table(printed.beside(rows, results))):
        print(f"{table.title}\n\n{table.markdown()}\n")
    failed = sum(not check.holds for check in checks)
    print(f"{failed} of {len(checks)} numbers do not follow from Table 1 within {printed.ROUNDING} dB")


def score_row(check: printed.Check, rows: Sequence[printed.PrintedRow]) -> list[str]:
    """Return a Score with its interval, which the paper does not print."""
    scheme = check.claim.scheme
    variant = check.claim.variant
    recomputed = printed.score_interval(rows, scheme, variant)
    numbers = [decimal(check.claim.value), str(interval(recomputed, recomputed.scenes)), signed(check.difference)]
    return [display_name(scheme), display_name(variant), *numbers, "yes" if check.holds else "no"]


def number_row(check: printed.Check) -> list[str]:
    """Return another number that follows from Table 1."""
    relation = "< " if check.claim.relation == "<" else ""
    claimed = f"{relation}{decimal(check.claim.value)}"
    numbers = [claimed, decimal(check.recomputed), signed(check.difference)]
    return [f"{check.claim.place}: {check.claim.words}", *numbers, "yes" if check.holds else "no"]


def as_csv(checks: Sequence[printed.Check]) -> str:
    """Return all checks as a table."""
    rows = []
    for check in checks:
        *claim, value = check.claim
        numbers = (f"{value:.2f}", f"{check.recomputed:.4f}", f"{check.difference:.4f}")
        rows.append([*map(str, claim), *numbers, str(check.holds)])
    return csv_text([*printed.Claim._fields[:-1], "printed", "recomputed", "difference", "holds"], rows)


def check_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table of checks."""
    headings = [Column(name, text=name in {"attack", "follows"}) for name in columns]
    return Table(title, headings, [TableRow([Cell(text) for text in row]) for row in rows])


def beside_table(rows: Sequence[printed.Beside]) -> Table:
    """Return the attacks of the paper's Table 1 beside ours."""
    quantities = ("scene drop", "message drop", "Score")
    columns = [Column("condition"), Column("attack", text=True), Column("our scenes")]
    columns += [Column(source, name) for name in quantities for source in ("paper", "ours")]
    table_rows = []
    for condition, alike in grouped(rows, lambda row: row.condition).items():
        for i, row in enumerate(alike):
            cells = [Cell("" if i else condition.title), Cell(display_name(row.variant))]
            cells.append(Cell(str(row.scenes or UNKNOWN)))
            papers = (row.paper_scene_drop, row.paper_message_drop, row.paper_score)
            ours = (row.scene_drop, row.message_drop, row.score)
            for published, measured in zip(papers, ours, strict=True):
                cells += [Cell(decimal(published)), Cell(decimal(measured))]
            table_rows.append(TableRow(cells, begins=i == 0))
    return Table("The attacks of Table 1", columns, table_rows, BESIDE)


if __name__ == "__main__":
    main(read_results(*map(Path, sys.argv[1:])))
