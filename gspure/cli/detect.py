"""``gspure detect``: read a mark from images, or from a model's file."""

from argparse import ArgumentTypeError
from pathlib import Path

import numpy as np

from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.files import file_digest
from gspure.metrics.csv_tables import write_table
from gspure.metrics.readings import Reading, read_marks
from gspure.model import is_trained_model, model_file
from gspure.progress import warn
from gspure.provenance import run_of
from gspure.schemes.commitment import COMMITMENT, Commitment
from gspure.schemes.registry import find_scheme
from gspure.settings import SECONDS, Range

MOST_KEYS = Range(99, 10_000_000)

EXAMPLES = """\
  gspure detect renders --command "python detect.py --key 7" --out scores.csv
  gspure detect renders --command "python decode.py --weights decoder.pt" --message 0110100110010110 --out bits.csv
  gspure detect renders --scheme marked_clones --key marked/key --out bits.csv
  gspure detect marked/public --key marked/key --out bits.csv                    # of a scheme that marks the file
  gspure detect suspect.ply --key marked/key --certify 1000000 --out bits.csv    # of keyed_pattern

A detector of your own gets the folder or file as its last argument. The last line that it prints must be a JSON object.
It maps the name of each image, without .png, or "model" to bits ({"view_000": "0110", ...}, with --message), or to a
score that is higher where the mark is present ({"view_000": 0.93, ...}, {"model": 0.93}).
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("marked", "SOURCE", "PNG files, such as renders; or a model, for marks in its file")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--command", metavar="WORDS", help="the detector: a program and its options")
    source.add_argument("--key", type=Path, metavar="DIR", help="the owner's key of a scheme that hides bits")
    parser.text("--scheme", "NAME", "the watermarking scheme (default: that of the key)")
    options.add_control_keys(parser)
    parser.text("--message", "BITS", "the embedded bits, if the detector returns bits", "", type=_bits)
    parser.number("--timeout", "S", "stop the detector after this many seconds", SECONDS, 600.0)
    parser.number("--certify", "KEYS", "rank the model's keyed pattern among those of KEYS other keys", MOST_KEYS)
    parser.reads("--commitment", "JSON", "what `gspure embed` wrote (default: beside the key)", required=False)
    parser.writes("--out", "CSV", "the table to write, one row per image")


def run(args: Arguments) -> None:
    """Write the table, and print the mean over the images."""
    scheme = options.key_scheme(args) if args.key else args.scheme
    source = model_file(args.marked) if is_trained_model(str(args.marked)) else args.marked
    if args.key:
        key = options.read_key(args, run_of(source))
        if source.is_file():
            public = find_scheme(scheme).read_public(source)
            readings = [key.certified(public, args.certify)] if args.certify else key.model_readings(public)
        else:
            readings = key.readings(source)
    else:
        readings = read_marks(args.command, source, args.message, args.timeout)
    write_table(args.out, Reading, readings)
    options.record_command(args, args.out.parent, resolved={"scheme": scheme})
    mean = f"{np.mean([reading.level for reading in readings]):.4g}"
    summary = f"{mean} % of the bits are correct on average" if readings[0].bits else f"mean score {mean}"
    print(f"{summary} over {len(readings)} images" if source.is_dir() else summary)
    if readings[0].p is not None:
        print(f"p = {readings[0].p:.3g}: probability of a pattern as strong under another key, by rank")
    if args.key:
        check_commitment(args.commitment or args.key.parent / COMMITMENT, scheme, args.key)


def check_commitment(file: Path, scheme: str, key: Path) -> None:
    """Say whether a key is the one that its owner committed to."""
    if not file.is_file():
        warn(f"{file}: no commitment: a key made after a model proves nothing about it")
        return
    commitment = Commitment.read(file)
    broken = commitment.broken_by(scheme, key)
    if broken:
        warn(f"{file}: the commitment does not hold: other than committed: {', '.join(broken)}")
    else:
        print(f"the commitment of {commitment.date} holds (SHA-256 of {file.name}: {file_digest(file)})")


def _bits(text: str) -> str:
    if {*text} - {*"01"}:
        raise ArgumentTypeError(f"expected a text of 0 and 1, found {text!r}")
    return text
