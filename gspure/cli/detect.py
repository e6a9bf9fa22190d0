"""``gspure detect``: read a mark from images."""

from __future__ import annotations

from argparse import ArgumentTypeError

from gspure.cli.parser import Arguments, Parser

HELP = "read a mark from a folder of images with a detector of your own"
EXAMPLES = """\
  gspure detect renders --command "python examples/spread_spectrum.py detect --seed 7" --out spread.csv
  gspure detect renders --command "python decode.py --weights decoder.pt" --message 0110100110010110 --out bits.csv

The folder is appended to the command. The last line that the command prints is a JSON object with an entry for each
image, by its name without .png: bits ("0110"; with --message) or a score (0.93; high if the mark is present).
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("images", "DIR", "PNG files")
    parser.text("--command", "WORDS", "the detector", required=True)
    parser.text("--message", "BITS", "the embedded bits, if the detector returns bits", "", type=_bits)
    parser.number("--timeout", "S", "seconds to wait for it", 600.0)
    parser.writes("--out", "CSV", "one row per image")


def run(args: Arguments) -> None:
    """Write the table, and print the mean."""
    import numpy as np

    from gspure.artifacts import write_provenance
    from gspure.evaluation.csv_tables import write_table
    from gspure.evaluation.detection import Reading
    from gspure.evaluation.detector import read_marks

    readings = read_marks(args.command, args.images, args.message, args.timeout)
    write_table(args.out, Reading, readings)
    images = {reading.view: args.images / f"{reading.view}.png" for reading in readings}
    write_provenance(args.out, inputs=images, settings={"command": args.command, "message": args.message})
    unit = "% of the bits are correct" if args.message else "score"
    print(f"{np.mean([reading.level for reading in readings]):.4g} {unit}, mean over {len(readings)} images")


def _bits(text: str) -> str:
    if {*text} - {*"01"}:
        raise ArgumentTypeError(f"expected a text of 0 and 1, found {text!r}")
    return text
