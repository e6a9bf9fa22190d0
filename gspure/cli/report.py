"""``gspure report``: one page about all models of a run."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.cli.outputs import Output

HELP = "write a self-contained HTML page with audit, tables, figures and provenance"
EXAMPLES = """\
  gspure report --table results.csv --figures results/planted/room/figures/*.png --out report.html
  gspure report --table results.csv \\
      --figures results/planted/room/figures/*.png results/planted/room/figures/model/*.png \\
      --diagnosis results/planted/room/diagnosis.json --provenance results/planted/room/*.np?.json \\
      --title "How robust is the watermark of this room?" --out report.html
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("--table", type=Path, required=True, metavar="CSV", help="from `gspure table`")
    parser.add_argument(
        "--figures",
        type=Path,
        nargs="*",
        default=[],
        metavar="PNG",
        help="from `gspure figures`, in display order, in folders SCHEME/SCENE or figures/CONDITION",
    )
    parser.add_argument(
        "--diagnosis",
        type=Path,
        nargs="*",
        default=[],
        metavar="JSON",
        help="from `gspure prune` or `gspure hidden`, in folders SCHEME/SCENE",
    )
    parser.add_argument(
        "--viewer",
        type=Path,
        nargs="*",
        default=[],
        metavar="JSON",
        help="from `gspure figures model`, in folders SCHEME/SCENE",
    )
    parser.add_argument("--matched", type=Path, metavar="CSV", help="from `gspure matched`")
    parser.add_argument("--contest", type=Path, metavar="CSV", help="from `gspure contest`")
    parser.add_argument("--survival", type=Path, metavar="CSV", help="from `gspure contest`")
    parser.add_argument(
        "--provenance", type=Path, nargs="*", default=[], metavar="JSON", help="provenance records to list"
    )
    parser.add_argument(
        "--link", type=Path, nargs="*", default=[], metavar="FILE", help="further files to link: configuration, logs"
    )
    parser.add_argument("--title", default="How robust is the watermark?", help="heading (default: %(default)s)")
    parser.add_argument("--out", type=Output, required=True, metavar="HTML", help="the page")


def run(args: argparse.Namespace) -> None:
    """Write the page."""
    from gspure.evaluation.contest import Contest
    from gspure.evaluation.matched import Matched
    from gspure.evaluation.records import read_records
    from gspure.evaluation.results import read_results
    from gspure.evaluation.survival import Survival
    from gspure.report.page import write_report

    write_report(
        args.out,
        args.title,
        read_results(args.table),
        figures=args.figures,
        diagnoses=args.diagnosis,
        matched=read_records(args.matched, Matched) if args.matched else [],
        survivals=read_records(args.survival, Survival) if args.survival else [],
        contests=read_records(args.contest, Contest) if args.contest else [],
        viewers=args.viewer,
        links=[file for file in (args.table, args.survival, args.contest, args.matched, *args.link) if file],
        provenance=args.provenance,
    )
    print(f"{args.out}: {args.out.stat().st_size / 1e6:.1f} MB, self-contained")
