"""Attacks on marks whose form is public and whose key is not."""

from typing import Annotated, Final

from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked, NotApplicable
from gspure.attacks.strength import Strength
from gspure.model.gaussians import COLOUR, Gaussians
from gspure.schemes.keyed_pattern.pattern import Grid
from gspure.schemes.keyed_pattern.residuals import smoothed
from gspure.settings import Amount, Range

CLIPPED: Final = 0.02  # largest change of a colour, several times the strength of a mark; ours
PASSES: Final = 3  # ours


def unmark(
    model: Gaussians,
    _rng: Rng,
    *,
    clip: Amount = CLIPPED,
    passes: Annotated[int, Range(1, 100)] = PASSES,
) -> Attacked:
    """Move the colour of every cell of a keyed pattern towards that of the cells around, by at most `clip`.

    The grid follows from the public rows, so the attack needs no key. Colours are 0 to 1, and a mark has about 0.005;
    each of the `passes` measures the cells again.

    Source: ours.
    """
    if model.sh_degree < 0 or not len(model):
        raise NotApplicable("unmark", "no view-independent colours")
    cleared = smoothed(model, Grid.of(model), clip, passes)
    return Attacked.changed(model, {name: cleared.table[name] for name in COLOUR})


ATTACKS = named({unmark: Strength("clip", 1e-4, 1.0, "log")})
