"""``gspure detect``: read a mark from images."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.cli.outputs import Output

HELP = "read a mark from a folder of images with a detector of your own"
EXAMPLES = """\
  gspure detect renders --command "python examples/spread_spectrum.py detect --seed 7" --out spread.csv
  gspure detect renders --command "python decode.py --weights decoder.pt" --message 0110100110010110 --out bits.csv

The folder is appended to the command. The last line that the command prints is a JSON object with an entry for each
image, by its name without .png: bits ("0110"; with --message) or a score (0.93; high if the mark is present).
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("images", type=Path, metavar="DIR", help="PNG files")
    parser.add_argument("--command", required=True, metavar="WORDS", help="the detector")
    parser.add_argument(
        "--message", type=_bits, default="", metavar="BITS", help="the embedded bits, if the detector returns bits"
    )
    parser.add_argument(
        "--timeout", type=float, default=600.0, metavar="S", help="seconds to wait for it (default: %(default)g)"
    )
    parser.add_argument("--out", type=Output, required=True, metavar="CSV", help="one row per image")


def run(args: argparse.Namespace) -> None:
    """Write the table, and print the mean."""
    import numpy as np

    from gspure.artifacts import write_provenance
    from gspure.evaluation.detection import Reading
    from gspure.evaluation.detector import read_marks
    from gspure.evaluation.csv_tables import write_table

    readings = read_marks(args.command, args.images, args.message, args.timeout)
    write_table(args.out, Reading, readings)
    images = {reading.view: args.images / f"{reading.view}.png" for reading in readings}
    write_provenance(args.out, inputs=images, settings={"command": args.command, "message": args.message})
    unit = "% of the bits are correct" if args.message else "score"
    print(f"{np.mean([reading.level for reading in readings]):.4g} {unit}, mean over {len(readings)} images")


def _bits(text: str) -> str:
    if {*text} - {*"01"}:
        raise argparse.ArgumentTypeError(f"expected a text of 0 and 1, found {text!r}")
    return text
