"""``gspure check-plugin``: whether a scheme or an attack keeps the rules for plug-ins."""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from gspure import progress
from gspure.attacks import attacks
from gspure.certificate.check import Check
from gspure.certificate.of_attacks import Trial, attack_checks
from gspure.certificate.of_schemes import scheme_checks
from gspure.cli.pair import PairSettings, make_pair
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.public_model import PublicModel
from gspure.schemes.pair import read_pair
from gspure.schemes.registry import schemes

EXAMPLES = """\
  gspure check-plugin rendered_bits      # after `pip install --editable .` in the folder of your package
  gspure check-plugin faint_pruning

Trains a scheme three times on a small ray-traced pair, or applies an attack to a small model. "ok": the rule of
docs/extending.md is kept; "FAILED": it is not; "note": a finding about the mark. Exit status 1 if a check failed.
"""

VIEWS: Final = 12
WIDTH: Final = 64
HEIGHT: Final = 48
STEPS: Final = 300  # of training
ROWS: Final = 3000
MOST: Final = {"iterations": STEPS, "max_gaussians": ROWS, "max_anchors": 800}  # of settings with these names


def add_arguments(parser: Parser) -> None:
    parser.text("name", "NAME", "a scheme or an attack of an installed plug-in, or a built-in one")


def run(args: Arguments) -> int:
    """Print a line per check; return 1 if a rule is broken."""
    progress.quiet = True
    is_broken = False
    with TemporaryDirectory() as folder:
        for number, found in enumerate(_checks(args.name, Path(folder)), 1):
            broken = found.is_rule and not found.passed
            is_broken |= broken
            mark = "FAILED" if broken else "ok" if found.passed else "note"
            print(f"{number:2}  {mark:<7}", ": ".join(filter(None, (found.name, found.problem))), flush=True)
    return int(is_broken)


def _checks(name: str, folder: Path) -> Iterator[Check]:
    """Yield the checks of a scheme or an attack, on a small pair in an empty folder."""
    known_schemes = schemes()
    known_attacks = attacks()
    if name not in {*known_schemes, *known_attacks}:
        names = ", ".join((*known_schemes, *known_attacks))
        raise InputError("check-plugin", "NAME", expected=f"one of {names}", found=repr(name))
    make_pair(PairSettings("room", "vault", views=VIEWS, width=WIDTH, height=HEIGHT), folder / "pair")
    pair = read_pair(folder / "pair")
    if name in known_schemes:
        scheme = known_schemes[name]
        settings = {name: min(most, scheme.settings[name]) for name, most in MOST.items() if name in scheme.settings}
        yield from scheme_checks(scheme, pair, settings, folder)
        return
    begin = pair.initial_gaussians(ROWS, seed=0)
    public = PublicModel(pair.scene.trained(begin, STEPS, ROWS, seed=0))
    dataset = pair.scene.dataset
    yield from attack_checks(Trial(known_attacks[name], public, dataset.train, dataset.test))
