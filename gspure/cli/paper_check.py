"""``gspure paper-check``: the paper's printed numbers against those that follow from its own tables."""

from collections.abc import Sequence

from gspure.cli.parser import Arguments, Parser
from gspure.evaluation import paper
from gspure.evaluation.csv_tables import read_table
from gspure.evaluation.names import display_name
from gspure.evaluation.survival import Survival
from gspure.files import write_text
from gspure.progress import decimal, signed
from gspure.report.table import Cell, Column, Row, Table, interval
from gspure.report.tables import beside_table

EXAMPLES = """\
  gspure paper-check --out paper.csv     # one row per number
  gspure paper-check --survival results/tables/survival.csv
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--survival", "CSV", "survival.csv of `gspure report`: our results beside the paper's", required=False)
    parser.writes("--out", "CSV", "also write all checks to this table", required=False)


def run(args: Arguments) -> None:
    """Write and print every check."""
    rows = paper.read_rows()
    checks = paper.check_claims(rows)
    ours = read_table(args.survival, Survival) if args.survival else []
    if args.out:
        write_text(args.out, _all(checks).csv())
    for table in (_scores(checks, rows), _without_scores(checks), beside_table(paper.beside(rows, ours))):
        print(f"{table.title}\n\n{table.markdown()}\n")
    failed = sum(not check.holds for check in checks)
    print(f"{failed} of {len(checks)} numbers do not follow from Table 1 within {paper.ROUNDING} dB")


def _scores(checks: Sequence[paper.Check], printed: Sequence[paper.Row]) -> Table:
    rows = []
    for check in (check for check in checks if check.claim.quantity == "score"):
        scheme, variant = check.claim.scheme, check.claim.variant
        recomputed = paper.score_interval(printed, scheme, variant)
        numbers = [decimal(check.claim.value), str(interval(recomputed, recomputed.scenes)), signed(check.difference)]
        rows.append([display_name(scheme), display_name(variant), *numbers, "yes" if check.holds else "no"])
    columns = ["scheme", "attack", "printed", "recomputed", "difference", "follows"]
    return _table("Scores in dB, recomputed from Table 1 with the 95% interval over its scenes", columns, rows)


def _without_scores(checks: Sequence[paper.Check]) -> Table:
    rows = []
    for check in (check for check in checks if check.claim.quantity != "score"):
        printed = f"{'< ' if check.claim.relation == '<' else ''}{decimal(check.claim.value)}"
        numbers = [printed, decimal(check.recomputed), signed(check.difference)]
        rows.append([f"{check.claim.place}: {check.claim.words}", *numbers, "yes" if check.holds else "no"])
    columns = ["place", "printed", "recomputed", "difference", "follows"]
    return _table("Other numbers in dB, recomputed from Table 1", columns, rows)


def _all(checks: Sequence[paper.Check]) -> Table:
    rows = []
    for check in checks:
        *claim, value = check.claim
        numbers = (f"{value:.2f}", f"{check.recomputed:.4f}", f"{check.difference:.4f}")
        rows.append([*map(str, claim), *numbers, str(check.holds)])
    columns = ["place", "words", "quantity", "scheme", "variant", "target", "relation", "printed"]
    return _table("Printed numbers", [*columns, "recomputed", "difference", "holds"], rows)


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    headings = [Column(name, text=name in {"attack", "follows"}) for name in columns]
    return Table(title, headings, [Row([Cell(text) for text in row]) for row in rows])
