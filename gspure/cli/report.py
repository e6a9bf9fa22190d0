"""``gspure report``: tables, figures and one page about all models of a run."""

from gspure.cli.parser import Arguments, Parser
from gspure.files import read_json
from gspure.progress import tell
from gspure.report.writing import write_report
from gspure.workflow.plan import Plan
from gspure.workflow.variants import report_plan

EXAMPLES = """\
  gspure report results                  # results/report.html, even if the run failed or still goes on
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("results", "DIR", "results folder of `gspure audit` or the workflow")


def run(args: Arguments) -> None:
    plan = report_plan(Plan(read_json(args.results / "configuration.json")))
    for outcome in write_report(args.results, plan):
        if outcome.failure:
            tell(f"gspure: {outcome.model.title}, {outcome.title}: no results: {outcome.failure}")
    print(args.results / "report.html")
