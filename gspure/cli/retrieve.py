"""``gspure retrieve``: compare extractions with the right message and with others."""

from pathlib import Path

from gspure.cli.options import add_quiet
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.progress import track

EXAMPLES = """\
  gspure retrieve pair/message --extractions results/splats_in_splats/room/*/renders/message --out retrieval.csv
  gspure retrieve pair/message --extractions results/splats_in_splats/room/*/renders/message \\
      --decoys other_pair/message decoys/* --out retrieval.csv
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("message", "DIR", "photographs of the message; those of the scene are in ../scene")
    parser.reads("--extractions", "DIR", "extracted images, in folders VARIANT/renders/TARGET", nargs="+")
    parser.reads("--decoys", "DIR", "photographs of other scenes, as candidates", nargs="*", default=[])
    parser.writes("--out", "CSV", "one row per variant and extraction")
    add_quiet(parser)


def run(args: Arguments) -> None:
    from gspure.artifacts import write_record
    from gspure.cameras.off_path import PREFIX
    from gspure.evaluation.comparison import pair_images
    from gspure.evaluation.csv_tables import write_table
    from gspure.evaluation.retrieval import Retrieved, compare_candidates, false_candidates, retrieval

    rows: list[Retrieved] = []
    used: set[Path] = set()
    for folder in track(args.extractions, "retrieval"):
        views = [pair for pair in pair_images(args.message, folder)[0] if not pair.view.startswith(PREFIX)]
        similarities = []
        for index, pair in enumerate(views):
            files = false_candidates(pair, index, args.decoys)
            similarities.append(compare_candidates(pair, files))
            used |= {pair.reference, pair.image, *files}
        if len(parts := folder.resolve().parts) < 4:
            raise InputError(folder, "folder", expected="VARIANT/renders/TARGET", found=str(folder.resolve()))
        variant, target = parts[-3], parts[-1]
        if any(row[:2] == (variant, target) for row in rows):
            raise InputError(folder, variant, expected="one folder for every variant and target", found="a second one")
        rows.append(Retrieved(variant, target, retrieval(similarities)))
    write_table(args.out, Retrieved, rows)
    write_record(args.out, inputs={path.as_posix(): path for path in sorted(used)}, settings={})
