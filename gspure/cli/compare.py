"""``gspure compare``: two audits beside each other, as before and after a scheme was changed."""

from pathlib import Path

from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError

EXAMPLES = """\
  gspure compare before/results after/results      # the robust radius, and what each attack leaves
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("before", "DIR", "results folder of `gspure audit`")
    parser.reads("after", "DIR", "another one")


def run(args: Arguments) -> None:
    """Print a table for every condition that both have, or for the only one of each."""
    from gspure.evaluation.results import read_results
    from gspure.report.answer import Answer, answers
    from gspure.report.beside import lines_beside

    def answers_of(results: Path) -> dict[str, Answer]:
        found = answers(read_results(results / "tables" / "results.csv"))
        return {answer.audit.condition.title: answer for answer in found}

    before = answers_of(args.before)
    after = answers_of(args.after)
    pairs = [(before[title], after[title]) for title in before if title in after]
    if not pairs and len(before) == len(after) == 1:
        pairs = [(next(iter(before.values())), next(iter(after.values())))]
    if not pairs:
        raise InputError(args.after, "conditions", expected=f"one of {', '.join(before)}", found=", ".join(after))
    for first, second in pairs:
        print("", *lines_beside(first, second, (str(args.before), str(args.after))), sep="\n")
