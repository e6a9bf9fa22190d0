"""``gspure forge``: what a forger without the owner's key reaches on a stranger's clean model."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gspure.arrays import UInt8
from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.evaluation.forging import Claim, Forger, forgeries
from gspure.files import write_text
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.targets import is_picture
from gspure.scenes.candidates import Kind, candidate_cameras, candidates
from gspure.schemes.pair import message_folder, read_pair
from gspure.schemes.registry import find_scheme, made_by
from gspure.schemes.scheme import FIT_STEPS
from gspure.settings import STEPS, Range
from gspure.text import decimal, p_value, percent
from gspure.workflow.pairs import candidates_of_message

TRIES = Range(19, 1_000_000)  # fewer pictures of a judge prove nothing

EXAMPLES = """\
  gspure forge clean/public --marked marked      # both by `gspure embed keyss pair`; clean: --set message_weight=0
  gspure forge clean/public --marked marked --steps 1000 --out forgery.csv

Needs a scheme of bits, or a message that `gspure pair` ray-traced. MODEL must be in the world of the forger's pair.
Prints claims, and writes neither keys nor models:

own model          the forger's key on the forger's own model, for comparison
fitted key         a key made for MODEL: it learned to show the message there, or claims the bits that it reads there
copied mark        the forger's mark, copied onto MODEL without a key
searched key       the best of N random keys
searched message   the one of N pictures that the forger's key shows best in MODEL

tries: steps, keys or pictures; read: the share of the picture that is legible, or of correct bits; p: the probability
of such a reading by chance, for a judge without clean models or a commitment (docs/statistics.md); fidelity: against
MODEL, ∞ if its file is unchanged. A commitment.json from before MODEL rules out keys made after it, not copies.
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("model", "MODEL", "the stranger's model, which holds no mark: a file, or its folder")
    parser.reads("--marked", "DIR", "the forger's own marked model: what `gspure embed` wrote")
    parser.text("--scheme", "NAME", "the watermarking scheme (default: that of the key)")
    parser.number("--steps", "N", "steps of training of a key that learns", STEPS, FIT_STEPS)
    parser.number("--tries", "N", "keys or pictures that the forger tries, and candidates of the judge", TRIES, 199)
    parser.writes("--out", "CSV", "also write the claims to this table", required=False)
    options.add_device(parser)


def run(args: Arguments) -> None:
    """Print the claims."""
    made_with, folder = made_by(args.marked / "key")
    scheme = find_scheme(args.scheme or made_with)
    public = scheme.read_public(args.marked / "public")
    stranger = scheme.read_public(args.model).drawn(args.model)
    if not stranger.visible:
        raise InputError(args.model, "model", expected=f"a whole model of {scheme.name}", found="one without colours")
    pictures = np.zeros((0, 0, 0, 0, 3), np.uint8)
    if is_picture(next(iter(scheme.extractions))):
        pictures = pictures_of(folder, 2 * args.tries)
    forger = Forger(
        scheme=scheme,
        public=public,
        key=scheme.read_key(args.marked / "key"),
        pair=read_pair(folder),
        candidates=pictures[: args.tries],
        choices=pictures[args.tries :],
        device=options.read_device(args),
    )
    claims = [*forgeries(forger, stranger, args.steps, args.tries)]
    if args.out:
        write_text(args.out, csv_text(Claim._fields, claims))
        options.record_command(args, args.out.parent)
    print("\n".join(lines(claims)))


def pictures_of(pair: Path, count: int) -> UInt8:
    """Return pictures of the kind of a pair's message, or raise `InputError` if it was not ray-traced."""
    known = candidates_of_message(message_folder(pair), count, "test")
    if known is None:
        raise InputError(pair, "message", expected="one that `gspure pair` ray-traced", found="another")
    cameras = candidate_cameras(known.views, known.width, known.height, known.split)
    return candidates(Kind(known.builder, known.placement), cameras, count)


def lines(claims: Sequence[Claim]) -> Iterator[str]:
    """Yield the claims as a table, and what a commitment does about them."""
    yield f"{'forgery':<18}{'tries':>8}{'read':>7}{'p':>9}{'fidelity dB':>13}"
    for claim in claims:
        numbers = f"{percent(claim.read / 100, 0):>7}{p_value(claim.p):>9}{decimal(claim.fidelity, 1):>13}"
        yield f"{claim.forgery:<18}{claim.tries:>8}{numbers}"
    late = [claim.forgery for claim in claims if claim.is_late]
    yield f"p: for a judge who asks for no commitment; one from before MODEL would rule out: {', '.join(late)}"
