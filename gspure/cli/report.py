"""``gspure report``: one page about all models of a run."""

from gspure.cli.options import add_files
from gspure.cli.parser import Arguments, Parser

EXAMPLES = """\
  gspure report --table results.csv --figures results/keyss/room/figures/*.png --out report.html
  gspure report --table results.csv \\
      --figures results/keyss/room/figures/*.png results/keyss/room/figures/model/*.png \\
      --diagnosis results/keyss/room/diagnosis.json --records results/keyss/room/*.np?.json --out report.html
"""


_FILES = {
    "--diagnosis": ("JSON", "from `gspure prune` or `gspure hidden`, in folders SCHEME/SCENE"),
    "--viewer": ("JSON", "from `gspure figures model`, in folders SCHEME/SCENE"),
    "--records": ("JSON", "records of artifacts to list"),
}


def add_arguments(parser: Parser) -> None:
    parser.reads("--table", "CSV", "from `gspure table`")
    for option in ("--contest", "--survival", "--matched", "--costs"):
        parser.reads(option, "CSV", "from `gspure contest`", required=False)
    meaning = "from `gspure figures`, in display order, in folders SCHEME/SCENE or figures/CONDITION"
    add_files(parser, {"--figures": ("PNG", meaning), **_FILES})
    add_files(parser, {"--link": ("FILE", "further files to link: configuration, logs")})
    parser.writes("--out", "HTML", "the page")


def run(args: Arguments) -> None:
    from gspure.evaluation.contest import Contest
    from gspure.evaluation.costs import AttackCost
    from gspure.evaluation.csv_tables import read_table
    from gspure.evaluation.matched import Matched
    from gspure.evaluation.results import read_results
    from gspure.evaluation.survival import Survival
    from gspure.report.page import write_report

    derived = [file for file in (args.survival, args.contest, args.matched) if file]
    write_report(
        args.out,
        read_results(args.table),
        figures=args.figures,
        diagnoses=args.diagnosis,
        matched=read_table(args.matched, Matched) if args.matched else [],
        survivals=read_table(args.survival, Survival) if args.survival else [],
        contests=read_table(args.contest, Contest) if args.contest else [],
        costs=read_table(args.costs, AttackCost) if args.costs else [],
        viewers=args.viewer,
        links=[args.table, *derived, *filter(None, [args.costs]), *args.link],
        records=args.records,
    )
    print(f"{args.out}: {args.out.stat().st_size / 1e6:.1f} MB, self-contained")
