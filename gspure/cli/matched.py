"""``gspure matched``: attacks compared at equal damage to the scene."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.cli.options import add_sweeps
from gspure.cli.outputs import Output

HELP = "measure the message's drop under each attack at equal damage to the scene"
EXAMPLES = """\
  gspure matched --table results.csv --sweep pruning=random_pruning_10,random_pruning_30 \\
      --sweep gspure=gspure,tau_n_1,tau_n_2 --out matched.csv --markdown matched.md
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("--table", type=Path, required=True, metavar="CSV", help="results, from `gspure table`")
    add_sweeps(parser)
    parser.add_argument("--out", type=Output, required=True, metavar="CSV", help="one row per sweep and damage")
    parser.add_argument("--markdown", type=Output, required=True, metavar="MD", help="the same as readable tables")


def run(args: argparse.Namespace) -> None:
    """Write the tables."""
    from gspure.artifacts import write_provenance, write_text
    from gspure.evaluation.matched import Matched, match
    from gspure.evaluation.records import write_records
    from gspure.evaluation.results import read_results
    from gspure.report.tables import conditions_markdown

    sweeps = dict(args.sweep)
    rows = match(read_results(args.table), sweeps)
    write_records(args.out, Matched, rows)
    write_text(args.markdown, conditions_markdown(matched=rows))
    write_provenance(args.out, inputs={"table": args.table}, settings={"sweeps": sweeps})
