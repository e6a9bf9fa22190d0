"""What forgers reach on a stranger's clean model, for each scheme: tables/forgery.csv.

pip install ./examples/marked_clones
python -m experiments.forgery FOLDER

Makes two pairs and trains the models in a folder, unless they are there. The stranger's clean model is another training
of the forger's scene, from the scene's points alone: a forger can always embed his mark in a scene that he trained from
renders of the stranger's. Claims are those of `gspure forge` (`gspure.evaluation.forging`), and of keyed patterns also

- ``subtracted``: the forger takes a mark of his own off the stranger's model, and claims to have the clean one. The
  pattern of his key depends on this clean model, which he did not know when he drew the mark;
- ``subtracted, keys without digest``: the same, if patterns did not depend on the clean model.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gspure.arrays import UInt8, load_array, save_array
from gspure.cli import main
from gspure.evaluation.forging import Claim, Forger, forgeries
from gspure.files import write_text
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.sign_ranks import certificate
from gspure.opencl.device import choose_device
from gspure.public_model import PublicModel
from gspure.scenes.candidates import Kind, candidate_cameras, candidates
from gspure.schemes.keyed_pattern.key import FORGED, KeyedPatternKey
from gspure.schemes.keyed_pattern.pattern import marked
from gspure.schemes.pair import read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import FIT_STEPS

TABLE = Path(__file__).resolve().parent / "tables" / "forgery.csv"
VIEWS, WIDTH, HEIGHT = 64, 96, 72
PAIRS = (("interior-611", "interior-701"), ("landscape-612", "interior-702"))  # scene and message
KIND = Kind("interior", "raised")  # of both messages
VANILLA = {"iterations": 700, "max_gaussians": 6000}
SCHEMES = {
    "splats_in_splats": VANILLA,
    "splats_in_splats_hardened": VANILLA,
    "keyss": {"iterations": 400, "max_gaussians": 4000},
    "secure_gs": {"iterations": 450, "max_anchors": 2500},
    "gs_hider": {"iterations": 400, "max_gaussians": 4000},
    "keyed_pattern": VANILLA,
    "rendered_bits": VANILLA,
}
FORMS = ("secure_gs", "gs_hider")  # schemes whose clean models are of another form than vanilla 3DGS
PICTURES = 199  # of the judge, and as many of the forger
KEYS = 1_000_000  # keyed patterns that the forger tries
COLUMNS = ("scene", "scheme", "forgery", "tries", "read %", "p", "fidelity dB", "commitment")


def embed(folder: Path, name: str, scheme: str, number: int, *options: str) -> Path:
    """Return the folder of a model, after training it unless it is there."""
    place = folder / f"{name}-{number}"
    if not place.is_dir():
        settings = [f"--set={setting}={value}" for setting, value in SCHEMES[scheme].items()]
        words = ["embed", scheme, str(folder / f"pair-{number}"), "--out", str(place), *settings, *options]
        assert main(words) == 0
    return place


def pictures(folder: Path) -> UInt8:
    """Return pictures of the messages' kind, after tracing them unless they are there."""
    file = folder / "pictures.npy"
    if not file.is_file():
        save_array(file, candidates(KIND, candidate_cameras(VIEWS, WIDTH, HEIGHT), 2 * PICTURES))
    return load_array(file, dtype=np.uint8, shape=(2 * PICTURES, None, None, None, 3))


def subtracted(stranger: PublicModel, key: KeyedPatternKey) -> Iterator[Claim]:
    """Yield the claims of a forger who takes his mark off a stranger's model."""
    draft = KeyedPatternKey.random(np.random.default_rng(5), len(key.bits), stranger.model, key.views)
    clean = marked(stranger.model, draft.grid, draft.pattern, -FORGED)
    claimed = KeyedPatternKey(draft.secret, draft.bits, clean, draft.views)
    findings = claimed.findings(stranger)
    values = findings.tries.reshape(len(findings.tries), -1)
    for name, pattern in (
        ("subtracted", claimed.pattern),
        ("subtracted, keys without digest", draft.pattern),
    ):
        p = certificate(values, pattern.mark(findings.cells).ravel()).p
        yield Claim(name, 1, np.nan, p, np.inf, is_late=True)


def claims(folder: Path, scheme: str, number: int) -> Iterator[Claim]:
    """Yield the claims on the stranger's model of a pair."""
    known = find_scheme(scheme)
    own = embed(folder, scheme, scheme, number)
    form = scheme if scheme in FORMS else next(iter(SCHEMES))
    clean = ("--set=message_weight=0", "--initialization=scene", "--seed=1")
    stranger = known.read_public(embed(folder, f"clean-{form}", form, number, *clean) / "public")
    shown = pictures(folder)
    pair = read_pair(folder / f"pair-{number}")
    public = known.read_public(own / "public")
    key = known.read_key(own / "key")
    forger = Forger(known, public, key, pair, shown[:PICTURES], shown[PICTURES:], choose_device())
    yield from forgeries(forger, stranger, FIT_STEPS, KEYS)
    if isinstance(key, KeyedPatternKey):
        yield from subtracted(stranger, key)


def rows(folder: Path) -> Iterator[list[str]]:
    """Yield the rows of the table."""
    for number, names in enumerate(PAIRS):
        if not (folder / f"pair-{number}").is_dir():
            size = [f"--views={VIEWS}", f"--width={WIDTH}", f"--height={HEIGHT}"]
            assert main(["pair", *names, *size, "--out", str(folder / f"pair-{number}")]) == 0
    for scheme in SCHEMES:
        for number, (scene, _) in enumerate(PAIRS):
            for claim in claims(folder, scheme, number):
                read = "" if np.isnan(claim.read) else f"{claim.read:.0f}"
                quality = "" if np.isinf(claim.fidelity) else f"{claim.fidelity:.1f}"
                commitment = "broken" if claim.is_late else "holds"
                row = [scene, scheme, claim.forgery, str(claim.tries), read, f"{claim.p:.2g}", quality, commitment]
                print(*row, flush=True)
                yield row


if __name__ == "__main__":
    write_text(TABLE, csv_text(COLUMNS, rows(Path(sys.argv[1]))))
