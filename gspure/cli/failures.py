"""``gspure failures``: the failed jobs of the workflow."""

from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError

EXAMPLES = """\
  gspure failures results      # exit status 1 if any job failed
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("folder", "FOLDER", "results, or any folder in it")


def run(args: Arguments) -> int:
    from gspure.failures import failures_below, summary

    if not args.folder.is_dir():
        raise InputError(args.folder, "folder", expected="a folder of results", found="no such folder")
    lines = summary(failures_below(args.folder))
    print(*lines, sep="\n", end="\n" if lines else "")
    return 1 if lines else 0
