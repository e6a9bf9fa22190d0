"""``gspure retrieve``: compare extractions with the right message and with others."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.cli.options import add_quiet
from gspure.cli.outputs import Output

HELP = "test whether extractions retrieve the message among candidates"
EXAMPLES = """\
  gspure retrieve pair/message --extractions results/planted/room/*/renders/message --out retrieval.csv
  gspure retrieve pair/message --extractions results/planted/room/*/renders/message \\
      --decoys other_pair/message decoys/scene decoys/message --out retrieval.csv
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument(
        "message", type=Path, metavar="DIR", help="photographs of the message; those of the scene are in ../scene"
    )
    parser.add_argument(
        "--extractions",
        type=Path,
        nargs="+",
        required=True,
        metavar="DIR",
        help="extracted images, in folders VARIANT/renders/TARGET",
    )
    parser.add_argument(
        "--decoys", type=Path, nargs="*", default=[], metavar="DIR", help="photographs of other scenes, as candidates"
    )
    parser.add_argument("--out", type=Output, required=True, metavar="CSV", help="one row per variant and extraction")
    add_quiet(parser)


def run(args: argparse.Namespace) -> None:
    """Write the table."""
    from gspure.artifacts import write_provenance
    from gspure.cameras.off_path import PREFIX
    from gspure.evaluation.comparison import pair_images
    from gspure.evaluation.records import write_records
    from gspure.evaluation.retrieval import Retrieved, compare_candidates, false_candidates, retrieval
    from gspure.progress import track

    rows, used = [], set()
    for folder in track(args.extractions, "retrieval"):
        views = [pair for pair in pair_images(args.message, folder)[0] if not pair.view.startswith(PREFIX)]
        similarities = []
        for index, pair in enumerate(views):
            files = false_candidates(pair, index, args.decoys)
            similarities.append(compare_candidates(pair, files))
            used |= {pair.reference, pair.image, *files}
        rows.append(Retrieved(folder.resolve().parts[-3], folder.name, retrieval(similarities)))
    write_records(args.out, Retrieved, rows)
    write_provenance(args.out, inputs={path.as_posix(): path for path in sorted(used)}, settings={})
