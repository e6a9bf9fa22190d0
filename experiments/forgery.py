"""What a forger of keyed patterns reaches on a stranger's clean model: tables/keyed_pattern-forgery.csv.

gspure pair room vault --views 32 --width 208 --height 156 --out room
gspure pair vault room --views 32 --width 208 --height 156 --out vault
python -m experiments.forgery room vault

The stranger's model is another training of the scene. Its forger takes a mark of his own off the model, and claims to
have the clean one. Then the pattern of his key is

- ``subtracted``: that of this clean model, which he did not know when he drew the mark;
- ``subtracted, keys without digest``: the mark, if patterns did not depend on the clean model;
- ``searched``: the best of many keys;
- ``fitted bits``: that of one key, and the message is what it reads.

``copied`` is another forgery: cells get what sets those of a marked model apart from the cells around, and so the mark
of its owner. z and p are those of the key among 9,999 others. A commitment from before the model was published holds
for the last alone.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from experiments.keyed_pattern import SETTINGS, STRANGERS, TABLES
from gspure.arrays import Float64
from gspure.files import write_text
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.sign_ranks import KEYS, certificate, largest_sums
from gspure.model import Gaussians
from gspure.public_model import PublicModel
from gspure.schemes.keyed_pattern.key import Findings, KeyedPatternKey
from gspure.schemes.keyed_pattern.pattern import Grid, Pattern, marked, recoloured
from gspure.schemes.keyed_pattern.residuals import cell_colours
from gspure.schemes.pair import Pair, read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import hide

BITS = 32
SEARCHED = 1_000_000
STRENGTH = 0.005  # of the forger's mark, of colours 0 to 1
LARGEST = 0.01  # part of a copied mark
COLUMNS = ("scene", "forgery", "keys tried", "z", "p", "commitment")

Claim = tuple[str, int, float, float, str]


def ranked(findings: Findings, pattern: Pattern) -> tuple[float, float]:
    """Return z and p of a pattern among those of other keys."""
    ranks = certificate(tries_of(findings), pattern.mark(findings.cells).ravel())
    return ranks.z, ranks.p


def tries_of(findings: Findings) -> Float64:
    """Return what a suspect shows, one row per try."""
    return findings.tries.reshape(len(findings.tries), -1)


def own_claims(stranger: Gaussians, pair: Pair) -> Iterator[Claim]:
    """Yield the claims by keys that were made after the model."""
    draft = KeyedPatternKey.random(np.random.default_rng(5), BITS, stranger, pair.scene.views)
    clean = marked(stranger, Grid.of(stranger), draft.pattern, -STRENGTH)
    key = KeyedPatternKey(draft.secret, draft.bits, clean, draft.views)
    findings = key.findings(PublicModel(stranger))
    yield "subtracted", 1, *ranked(findings, key.pattern), "broken"
    yield "subtracted, keys without digest", 1, *ranked(findings, draft.pattern), "broken"
    best = float(largest_sums(tries_of(findings), SEARCHED).max())
    others = largest_sums(tries_of(findings), KEYS)
    yield "searched", SEARCHED, best, (1 + np.count_nonzero(others >= best)) / (KEYS + 1), "broken"
    yield "fitted bits", 1, *ranked(findings, Pattern(key.pattern.words, key.decoded(findings))), "broken"


def copied(source: Gaussians, onto: Gaussians) -> Gaussians:
    """Return a model with what sets the cells of another one apart from those around, as far as it can be a mark."""
    grid = Grid.of(source)
    estimated = cell_colours(source, grid)
    wanted = grid.cells(onto)
    places = np.minimum(np.searchsorted(estimated.cells, wanted), len(estimated.cells) - 1)
    is_known = estimated.cells[places] == wanted
    changes = np.clip(estimated.residuals, -LARGEST, LARGEST)[places]
    return recoloured(onto, np.where(is_known[:, None], changes, 0))


def rows() -> Iterator[list[str]]:
    """Yield the rows of the table."""
    scheme = find_scheme("keyed_pattern")
    for folder in sys.argv[1:]:
        pair = read_pair(Path(folder))
        stranger, _ = hide(scheme, pair, seed=1, message_weight=0, **STRANGERS)
        public, key = hide(scheme, pair, **SETTINGS)
        assert isinstance(key, KeyedPatternKey)
        framed = key.findings(PublicModel(copied(public.model, stranger.model)))
        claims = [*own_claims(stranger.model, pair), ("copied", 0, *ranked(framed, key.pattern), "holds")]
        for name, tried, z, p, commitment in claims:
            print(folder, name, tried, z, p, flush=True)
            yield [Path(folder).name, name, str(tried), f"{z:.1f}", f"{p:.1e}", commitment]


if __name__ == "__main__":
    write_text(TABLES / "keyed_pattern-forgery.csv", csv_text(COLUMNS, rows()))
