"""``gspure stages``: look after the stored per-view contributions."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.errors import InputError

HELP = "delete stored contributions that no result uses any more"
EXAMPLES = """\
  gspure stages prune
  gspure stages prune --stages /scratch/stages --results /scratch/results
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("action", choices=["prune"], help="prune: delete every stage file that no index lists")
    parser.add_argument(
        "--stages", type=Path, default=Path("stages"), metavar="DIR", help="folder of stages (default: %(default)s)"
    )
    parser.add_argument(
        "--results",
        type=Path,
        default=Path("results"),
        metavar="DIR",
        help="folder searched for indices (default: %(default)s)",
    )


def run(args: argparse.Namespace) -> None:
    """Delete unlisted stages and say how much room that freed; not to be used while a run is under way."""
    from gspure.contributions import remove_unlisted

    indices = sorted(args.results.glob("**/contributions/*.tsv"))
    if not indices:
        hint = "to drop every stage, delete the folder of stages"
        raise InputError(args.results, "contributions/*.tsv", expected="at least one index", found="none", hint=hint)
    files, freed = remove_unlisted(args.stages, indices)
    print(f"{files} files deleted, {freed} bytes ({freed / 1e6:.1f} MB) freed")
