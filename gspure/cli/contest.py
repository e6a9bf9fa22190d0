"""``gspure contest``: survival of the message, and GSPure against every other attack."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gspure.cli.options import add_sweeps, read_sweeps
from gspure.cli.parser import Arguments, Parser

EXAMPLES = """\
  gspure contest --table results.csv --out contest.csv --survival survival.csv --matched matched.csv \\
      --markdown contest.md
  gspure contest --table results.csv --sweep gspure=gspure,tau_n_1,tau_n_2 \\
      --sweep pruning=random_pruning_10,random_pruning_30 \\
      --out contest.csv --survival survival.csv --matched matched.csv --markdown contest.md
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--table", "CSV", "results, from `gspure table`")
    add_sweeps(parser)
    parser.writes("--out", "CSV", "differences: GSPure minus every other attack")
    parser.writes("--survival", "CSV", "the message after each attack, against controls")
    parser.writes("--matched", "CSV", "the message's drop at equal damage to the scene")
    meaning = "folder with the costs SCHEME/SCENE/VARIANT/attack.cost.json"
    parser.reads("--benchmarks", "DIR", meaning, required=False)
    parser.writes("--costs", "CSV", "the cost of each attack, from --benchmarks", required=False)
    parser.writes("--markdown", "MD", "all of these as readable tables")


def run(args: Arguments) -> None:
    from gspure.artifacts import write_record, write_text
    from gspure.evaluation.contest import Contest, contest
    from gspure.evaluation.costs import AttackCost, attack_costs
    from gspure.evaluation.csv_tables import write_table
    from gspure.evaluation.matched import Matched, match
    from gspure.evaluation.results import read_results
    from gspure.evaluation.survival import Survival, survival
    from gspure.report.tables import conditions_markdown

    outcomes = read_results(args.table)
    sweeps = read_sweeps(args, outcomes)
    contests, survivals, matched = contest(outcomes, sweeps), survival(outcomes), match(outcomes, sweeps)
    costs = attack_costs(outcomes, sweeps, args.benchmarks) if args.benchmarks else []
    origin: dict[str, Any] = {"inputs": {"table": args.table}, "settings": {"sweeps": sweeps}}
    tables: list[tuple[Path, type, Sequence[Any]]] = [(args.costs, AttackCost, costs)] if args.costs else []
    tables += [(args.out, Contest, contests), (args.survival, Survival, survivals), (args.matched, Matched, matched)]
    for path, kind, rows in tables:
        write_table(path, kind, rows)
        write_record(path, **origin)
    write_text(args.markdown, conditions_markdown(survivals, contests, matched, costs))
    write_record(args.markdown, **origin)
