"""``gspure detect``: read a mark from images."""

from __future__ import annotations

from argparse import ArgumentTypeError
from pathlib import Path
from typing import TYPE_CHECKING

from gspure.cli.parser import Arguments, Parser
from gspure.settings import SECONDS

if TYPE_CHECKING:
    from gspure.evaluation.detection import Reading

EXAMPLES = """\
  gspure detect renders --command "python examples/spread_spectrum.py detect --key 7" --out spread.csv
  gspure detect renders --command "python decode.py --weights decoder.pt" --message 0110100110010110 --out bits.csv
  gspure detect renders --scheme marked_clones --key marked/key --out bits.csv

A detector of your own gets the folder as its last argument. The last line that it prints must be a JSON object that
maps the name of each image, without .png, to bits, with --message ({"view_000": "0110", ...}), or to a score, which is
high if the mark is present ({"view_000": 0.93, ...}).
"""


def add_arguments(parser: Parser) -> None:
    from gspure.cli.options import add_control_keys

    parser.reads("images", "DIR", "PNG files, such as renders")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--command", metavar="WORDS", help="the detector: a program and its options")
    source.add_argument("--key", type=Path, metavar="DIR", help="the owner's key of a scheme that hides bits")
    parser.text("--scheme", "NAME", "the scheme of the key")
    add_control_keys(parser)
    parser.text("--message", "BITS", "the embedded bits, if the detector returns bits", "", type=_bits)
    parser.number("--timeout", "S", "seconds after which the detector is stopped", SECONDS, 600.0)
    parser.writes("--out", "CSV", "the table to write, one row per image")


def run(args: Arguments) -> None:
    """Write the table, and print the mean over the views on the camera path."""
    import numpy as np

    from gspure.artifacts import write_record
    from gspure.cameras.off_path import PREFIX
    from gspure.errors import InputError
    from gspure.evaluation.csv_tables import write_table
    from gspure.evaluation.detection import KEY, Reading
    from gspure.evaluation.detector import read_marks
    from gspure.evaluation.outcomes import SCENE
    from gspure.images import origin_of, shown_in, with_records

    _require_fitting_options(args)
    if (target := origin_of(args.images, "target")) not in {"", SCENE}:
        hint = "a detector reads renders of the scene"
        raise InputError(args.images, "target", expected=SCENE, found=target, hint=hint)
    before = _files_of(args.command)
    readings = _read_bits(args) if args.key else read_marks(args.command, args.images, args.message, args.timeout)
    write_table(args.out, Reading, readings)
    images = with_records(args.images / f"{reading.view}.png" for reading in readings)
    settings = {"command": args.command, "message": args.message} if args.command else {"scheme": args.scheme}
    settings |= {KEY: owner} if (owner := _owner(args)) else {}
    after = _files_of(args.command)
    files = {name: digest for name, digest in before.items() if after.get(name) == digest}  # no logs
    write_record(args.out, inputs=images, settings=settings | files | shown_in(args.images))
    counted = [reading for reading in readings if not reading.view.startswith(PREFIX)] or readings
    mean = f"{np.mean([reading.level for reading in counted]):.4g}"
    found = f"{mean} % of the bits are correct on average" if readings[0].bits else f"mean score {mean}"
    print(f"{found} over {len(counted)} images")


def _files_of(command: str | None) -> dict[str, str]:
    """Return the files that a command names, as settings of its readings: with their digests."""
    from gspure.artifacts import file_digest
    from gspure.evaluation.detection import FILE
    from gspure.evaluation.detector import files_of

    return {f"{FILE}{name}": file_digest(Path(name)) for name in files_of(command)} if command else {}


def _require_fitting_options(args: Arguments) -> None:
    """Refuse options that the chosen source of readings does not use."""
    from gspure.errors import InputError

    of_key = {"--scheme": args.scheme, "--wrong-key": args.wrong_key, "--control": args.control or None}
    unused = {"--message": args.message} if args.key else of_key
    for option in (option for option, value in unused.items() if value not in (None, "")):
        expected = f"none with --{'key' if args.key else 'command'}"
        raise InputError("detect", option, expected=expected, found=str(unused[option]))


def _read_bits(args: Arguments) -> list[Reading]:
    """Return what the key reads from every image."""
    from gspure.cli.options import read_key
    from gspure.errors import InputError
    from gspure.evaluation.detector import read_bits
    from gspure.images import origin_of

    if not args.scheme:
        raise InputError("detect", "--scheme", expected="the scheme of the key", found="none")
    key = read_key(args, origin_of(args.images, "embedding"))
    return read_bits(key.read_bits, key.bits, args.images)


def _owner(args: Arguments) -> str:
    """Return the embedding of the key, as records name it; empty without a key."""
    from gspure.artifacts import embedding_of
    from gspure.evaluation.controls import WRONG_KEY

    if args.wrong_key is not None:
        return WRONG_KEY
    return embedding_of(args.key) if args.key else ""


def _bits(text: str) -> str:
    if {*text} - {*"01"}:
        raise ArgumentTypeError(f"expected a text of 0 and 1, found {text!r}")
    return text
