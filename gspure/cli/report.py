"""``gspure report``: tables, figures and one page about all models of a run."""

from gspure.cli.parser import Arguments, Parser
from gspure.evaluation.plan import read_plan
from gspure.progress import tell
from gspure.report.writing import write_report

EXAMPLES = """\
  gspure report results                  # results/report.html, even if the run failed or still goes on
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("results", "DIR", "results folder of `gspure audit` or the workflow")


def run(args: Arguments) -> None:
    for outcome in write_report(args.results, read_plan(args.results)):
        if outcome.failure:
            tell(f"gspure: {outcome.model.title}, {outcome.title}: no results: {outcome.failure}")
    print(args.results / "report.html")
