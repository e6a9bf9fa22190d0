"""``gspure contest``: survival of the message, and GSPure against every other attack."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.cli.options import add_sweeps, read_sweeps
from gspure.cli.outputs import Output

HELP = "measure the survival of the message, and compare GSPure with every other attack"
EXAMPLES = """\
  gspure contest --table results.csv --out contest.csv --survival survival.csv --matched matched.csv \\
      --markdown contest.md
  gspure contest --table results.csv --sweep gspure=gspure,tau_n_1,tau_n_2 \\
      --sweep pruning=random_pruning_10,random_pruning_30 \\
      --out contest.csv --survival survival.csv --matched matched.csv --markdown contest.md
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("--table", type=Path, required=True, metavar="CSV", help="results, from `gspure table`")
    add_sweeps(parser)
    parser.add_argument("--out", type=Output, required=True, metavar="CSV", help="GSPure minus every other attack")
    parser.add_argument(
        "--survival",
        type=Output,
        required=True,
        metavar="CSV",
        help="the message after each attack, against controls",
    )
    parser.add_argument(
        "--matched", type=Output, required=True, metavar="CSV", help="the message's drop at equal damage to the scene"
    )
    parser.add_argument(
        "--benchmarks",
        type=Path,
        metavar="DIR",
        help="folder with the costs SCHEME/SCENE/VARIANT/attack.cost.json",
    )
    parser.add_argument("--costs", type=Output, metavar="CSV", help="the cost of each attack, from --benchmarks")
    parser.add_argument("--markdown", type=Output, required=True, metavar="MD", help="all of these as readable tables")


def run(args: argparse.Namespace) -> None:
    """Write the tables."""
    from gspure.artifacts import write_provenance, write_text
    from gspure.evaluation.contest import Contest, contest
    from gspure.evaluation.costs import AttackCost, attack_costs
    from gspure.evaluation.matched import Matched, match
    from gspure.evaluation.records import write_records
    from gspure.evaluation.results import read_results
    from gspure.evaluation.survival import Survival, survival
    from gspure.report.tables import conditions_markdown

    outcomes = read_results(args.table)
    sweeps = read_sweeps(args, outcomes)
    contests, survivals, matched = contest(outcomes, sweeps), survival(outcomes), match(outcomes, sweeps)
    costs = attack_costs(outcomes, sweeps, args.benchmarks) if args.benchmarks else []
    if args.costs:
        write_records(args.costs, AttackCost, costs)
    write_records(args.out, Contest, contests)
    write_records(args.survival, Survival, survivals)
    write_records(args.matched, Matched, matched)
    write_text(args.markdown, conditions_markdown(survivals, contests, matched, costs))
    for path in (args.out, args.survival, args.matched, args.markdown):
        write_provenance(path, inputs={"table": args.table}, settings={"sweeps": sweeps})
