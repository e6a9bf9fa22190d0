"""``gspure demo``: the whole evaluation on a scene made here."""

from pathlib import Path

from gspure.cli import options
from gspure.cli.audit import RunOptions, add_run_options, audited
from gspure.cli.parser import Arguments, Parser
from gspure.files import alone_in
from gspure.workflow.auditing import snakefile

EXAMPLES = """\
  gspure demo              # results/report.html, in a few minutes on two CPU cores
"""


def add_arguments(parser: Parser) -> None:
    add_run_options(parser)


def run(args: Arguments) -> int:
    """Run the demo's configuration."""
    with alone_in(Path.cwd()):
        return audited(options.typed(args, RunOptions), snakefile().parent / "config" / "config.yaml")
