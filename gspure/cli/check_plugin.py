"""``gspure check-plugin``: whether a scheme, an attack or a detector keeps the rules for plug-ins."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from gspure import progress
from gspure.attacks import attacks
from gspure.cameras import Camera
from gspure.certificate.check import Check
from gspure.certificate.of_attacks import Trial, attack_checks
from gspure.certificate.of_detectors import detector_checks
from gspure.certificate.of_schemes import scheme_checks
from gspure.cli.pair import PairSettings, make_pair
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.images import write_image
from gspure.model import write_model
from gspure.plugins import detectors
from gspure.public_model import PublicModel
from gspure.schemes.pair import read_pair
from gspure.schemes.registry import schemes

EXAMPLES = """\
  gspure check-plugin rendered_bits      # after `pip install --editable .` in the folder of your package
  gspure check-plugin faint_pruning

Trains a scheme three times on a small ray-traced pair, applies an attack to a small model, or gives a detector a small
model and its renders. "ok": the rule of docs/extending.md is kept; "FAILED": it is not; "note": a finding that breaks
no rule. Exit status 1 if a check failed.
"""

VIEWS: Final = 12
WIDTH: Final = 64
HEIGHT: Final = 48
STEPS: Final = 300  # of training
ROWS: Final = 3000
MOST: Final = {"iterations": STEPS, "max_gaussians": ROWS, "max_anchors": 800}  # of settings with these names


def add_arguments(parser: Parser) -> None:
    parser.text("name", "NAME", "a scheme, an attack or a detector of an installed plug-in, or a built-in one")


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
    """Yield the checks of a scheme, an attack or a detector, on a small pair in an empty folder."""
    known_schemes = schemes()
    known_attacks = attacks()
    known_detectors = detectors()
    if name not in {*known_schemes, *known_attacks, *known_detectors}:
        names = ", ".join((*known_schemes, *known_attacks, *known_detectors))
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
    if name in known_attacks:
        yield from attack_checks(Trial(known_attacks[name], public, dataset.train, dataset.test))
        return
    renders, model = _published(public, dataset.test, folder)
    yield from detector_checks(name, known_detectors[name], renders, model)


def _published(public: PublicModel, views: Sequence[Camera], folder: Path) -> tuple[Path, Path]:
    """Write what a detector may read: renders of a model, and its file."""
    scene = public.scene()
    (folder / "renders").mkdir()
    for camera in views:
        write_image(folder / "renders" / f"{camera.name}.png", scene(camera))
    write_model(folder / "model.ply", public.model)
    return folder / "renders", folder / "model.ply"
