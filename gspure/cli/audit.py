"""``gspure audit``: the workflow on the user's models, from a checkout or an installed package, and its answer."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from shutil import get_terminal_size
from textwrap import fill
from typing import Final

from gspure.cli import options
from gspure.cli.options import QUIET, add_cameras
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.evaluation.identity import RESULTS
from gspure.settings import CORES
from gspure.workflow.auditing import prepared, run_to_report, snakemake_options
from gspure.workflow.console import Console
from gspure.workflow.request import SUITE, AuditRequest
from gspure.workflow.running import forecast
from gspure.workflow.running import run as run_workflow

EXAMPLES = """\
  gspure audit point_cloud.ply                              # all attacks on the scene: results/report.html
  gspure audit marked/public --key marked/key               # and what is left of the message, as its owner sees it
  gspure audit marked/public --key marked/key --fail-under 1dB      # status 3 if the robust radius is below 1 dB
  gspure audit marked/public --key marked/key --everyday    # what customers do: formats, crops, fewer rows
  gspure audit marked/public --key marked/key --suite standard-1 --out standard      # for publications: hours
  gspure audit mine.yaml --cores 4                          # a configuration, with all settings of the workflow
  gspure audit mine.yaml -- --forcerun evaluate_variant     # options of Snakemake
"""

SUCCESS: Final = 0
FAILED: Final = 2
LOST: Final = 3
_STATUSES = """
exit status: 0, even if the message is gone; 2 after bad input or failed jobs; 3 if the robust radius is smaller than
--fail-under; 130 after Ctrl-C: the next run resumes there. docs/troubleshooting.md lists more.
"""


def add_arguments(parser: Parser) -> None:
    meaning = "file of a 3DGS model, or folder of a training run; or a configuration of the workflow, .yaml"
    parser.reads("source", "MODEL|CONFIG", meaning)
    parser.reads("--key", "DIR", "the owner's key, from `gspure embed`, to extract the message", required=False)
    meaning = "photographs of the message, with cameras (default: the key's pair's, or the extraction before attacks)"
    parser.reads("--message", "DIR", meaning, required=False)
    default = " (default: those of the key's pair, or beside MODEL, or orbit)"
    add_cameras(parser, "views of MODEL", more=default, required=False)
    parser.text("--suite", "NAME", f"attacks and strengths to try: small-1, standard-1 (default with --key: {SUITE})")
    parser.flag("--everyday", "what customers do, instead of attacks: half precision, web formats, fewer rows, crops")
    meaning = "folder of the results (default: here or, if it holds those of another audit, a new subfolder)"
    parser.writes("--out", "DIR", meaning, required=False)
    add_run_options(parser)


def add_run_options(parser: Parser) -> None:
    """Add the options of `audited`."""
    parser.flag("--json", "print the answer as JSON")
    meaning = "exit with status 3 if the robust radius is smaller: an attack with less damage ends the message"
    parser.text("--fail-under", "DB", meaning, type=decibels)
    parser.flag("-n", "--dry-run", "count the jobs that would run; with -v, list them, and why")
    parser.number("-c --cores", "N", "number of cores (default: all)", CORES)
    parser.flag(*QUIET)
    parser.flag("-v", "--verbose", "print Snakemake's output instead of progress; implied by options after --")
    parser.set_defaults(passed_on=[])  # what follows `--`
    parser.epilog = f"{parser.epilog}{_STATUSES}"


@dataclass(frozen=True)
class RunOptions:
    """The options of `audited`."""

    json: bool
    fail_under: float | None
    dry_run: bool
    cores: int | None
    verbose: bool
    passed_on: Sequence[str]


def run(args: Arguments) -> int:
    """Write the configuration of a model, and run Snakemake; a dry run writes to a temporary folder only."""
    wanted = options.typed(args, AuditRequest)
    run_options = options.typed(args, RunOptions)
    has_limit = run_options.fail_under is not None
    if has_limit and not wanted.is_configuration and not wanted.key:
        hint = "only the owner's key tells when a message is gone"
        raise InputError("audit", "--key", expected="one beside --fail-under", found="none", hint=hint)
    with prepared(wanted, is_rehearsal=run_options.dry_run) as (configuration, place):
        return audited(run_options, configuration, place)


def audited(run_options: RunOptions, configuration: Path, place: Path = Path()) -> int:
    """Run Snakemake, then print the answer, and return the exit status.

    With options after ``--``, all output is Snakemake's. Jobs that failed leave the answer for the other variants.
    `place` is the current folder, as its user named it.
    """
    words = [*snakemake_options(configuration, run_options.cores), *run_options.passed_on]
    if run_options.dry_run:
        return _rehearsed(run_options, ["--dry-run", *words])
    if run_options.passed_on:
        return SUCCESS if run_workflow(words) else FAILED
    outcome = run_to_report(words, None if run_options.verbose else Console())
    if not outcome.has_report:
        return FAILED
    damages = _answer(place, as_json=run_options.json)
    if not outcome.succeeded:
        return FAILED
    if run_options.fail_under is None:
        return SUCCESS
    if not damages:
        raise InputError("audit", "--fail-under", expected="a message with a robust radius", found="none")
    return LOST if min(damages) < run_options.fail_under else SUCCESS


def _rehearsed(run_options: RunOptions, words: Sequence[str]) -> int:
    """Print how many jobs would run or, if asked, all that Snakemake says of them; return the exit status."""
    if run_options.verbose or run_options.passed_on:
        return SUCCESS if run_workflow(words) else FAILED
    lines = forecast(words)
    if lines:
        print(*lines, sep="\n")
    return SUCCESS if lines else FAILED


def _answer(place: Path, *, as_json: bool) -> list[float]:
    """Print the verdict of every condition; return the known damages, dB, at which messages are gone."""
    from gspure.evaluation.results import read_results
    from gspure.report.answer import answers

    conditions = answers(read_results(RESULTS / "tables" / "results.csv"))
    if as_json:
        print(json.dumps([answer.facts() for answer in conditions], indent=2))
    else:
        for answer in conditions:
            *table, sentence = answer.lines()
            print("", *table, fill(sentence, get_terminal_size((120, 24)).columns), sep="\n")
        print(f"\n{place / RESULTS / 'report.html'}")
    return [answer.audit.damage for answer in conditions if answer.audit.has_radius]


def decibels(text: str) -> float:
    """Return a number with or without its unit; an argument type."""
    return float(text.removesuffix("dB"))
