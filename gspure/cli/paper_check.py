"""``gspure paper-check``: the paper's printed numbers against those that follow from its own tables."""

from collections.abc import Sequence

from gspure.cli.parser import Arguments, Parser
from gspure.evaluation import paper
from gspure.evaluation.results import read_results
from gspure.files import write_text
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.names import display_name
from gspure.report.table import Cell, Column, Table, TableRow, interval
from gspure.report.tables import beside_table
from gspure.text import decimal, signed

EXAMPLES = """\
  gspure paper-check --out paper.csv     # one row per number
  gspure paper-check --results results/tables/results.csv
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--results", "CSV", "results.csv of `gspure report`: our results beside the paper's", required=False)
    parser.writes("--out", "CSV", "also write all checks to this table", required=False)


def run(args: Arguments) -> None:
    """Write and print every check."""
    printed = paper.read_rows()
    checks = paper.check_claims(printed)
    ours = read_results(args.results) if args.results else []
    if args.out:
        write_text(args.out, _as_csv(checks))
    title = "Scores in dB, recomputed from Table 1 with the 95% interval over its scenes"
    columns = ["scheme", "attack", "printed", "recomputed", "difference", "follows"]
    scores = _table(title, columns, [_score(check, printed) for check in checks if check.claim.quantity == "score"])
    title = "Other numbers in dB, recomputed from Table 1"
    columns = ["place", "printed", "recomputed", "difference", "follows"]
    others = _table(title, columns, [_number(check) for check in checks if check.claim.quantity != "score"])
    for table in (scores, others, beside_table(paper.beside(printed, ours))):
        print(f"{table.title}\n\n{table.markdown()}\n")
    failed = sum(not check.holds for check in checks)
    print(f"{failed} of {len(checks)} numbers do not follow from Table 1 within {paper.ROUNDING} dB")


def _score(check: paper.Check, printed: Sequence[paper.PrintedRow]) -> list[str]:
    scheme = check.claim.scheme
    variant = check.claim.variant
    recomputed = paper.score_interval(printed, scheme, variant)
    numbers = [decimal(check.claim.value), str(interval(recomputed, recomputed.scenes)), signed(check.difference)]
    return [display_name(scheme), display_name(variant), *numbers, "yes" if check.holds else "no"]


def _number(check: paper.Check) -> list[str]:
    relation = "< " if check.claim.relation == "<" else ""
    printed = f"{relation}{decimal(check.claim.value)}"
    numbers = [printed, decimal(check.recomputed), signed(check.difference)]
    return [f"{check.claim.place}: {check.claim.words}", *numbers, "yes" if check.holds else "no"]


def _as_csv(checks: Sequence[paper.Check]) -> str:
    rows = []
    for check in checks:
        *claim, value = check.claim
        numbers = (f"{value:.2f}", f"{check.recomputed:.4f}", f"{check.difference:.4f}")
        rows.append([*map(str, claim), *numbers, str(check.holds)])
    return csv_text([*paper.Claim._fields[:-1], "printed", "recomputed", "difference", "holds"], rows)


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    headings = [Column(name, text=name in {"attack", "follows"}) for name in columns]
    return Table(title, headings, [TableRow([Cell(text) for text in row]) for row in rows])
