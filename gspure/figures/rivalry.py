"""In words: where GSPure is not the best attack, and whether any difference can be taken seriously."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isnan
from typing import Final

from gspure.evaluation.contest import MESSAGE_DROP, SCENE_DROP, SCORE, Contest
from gspure.evaluation.statistics import MATCHED_DAMAGES, Interval
from gspure.figures.findings import spoken
from gspure.figures.wording import db, how_sure, is_sure, listed, mirrored, plural

RANDOM: Final = "random_matched"
"""The attack that removes as many rows as GSPure at random: what takes no more than this has done nothing."""

SIGNIFICANT: Final = 0.05

EQUAL: Final = 0.05
"""What is no difference on average, dB: less than the page shows."""


def points(contests: Sequence[Contest]) -> Iterator[tuple[str, str]]:
    """Yield labels and sentences about the rivals of GSPure on one extraction of one scheme."""
    as_run = [c for c in contests if isnan(c.damage)]
    chance = {c.quantity: c.difference for c in as_run if c.rival == RANDOM}
    if chance:
        yield "Against chance", _against_chance(chance[MESSAGE_DROP], chance[SCENE_DROP])
    scores = [c for c in as_run if c.quantity == SCORE]
    if scores:
        yield "Is GSPure the best?", _best(scores)
    equal = [sentence for damage in MATCHED_DAMAGES for sentence in _at(damage, contests)]
    if equal:
        yield "At equal damage", " ".join(equal)


def certainty(contests: Sequence[Contest]) -> str:
    """Return whether a difference in Score is significant, or could be with so few scenes."""
    tests = [c for c in contests if c.quantity == SCORE and isnan(c.damage)]
    if not tests:
        return ""
    best = min(c.attainable for c in tests)
    if best > SIGNIFICANT:
        among = f"{plural(max(c.difference.scenes for c in tests), 'scene')} and {plural(len(tests), 'rival')}"
        return f"With {among}, no difference in Score can be significant: corrected, p is {best:.2g} at best."
    found = listed(f"{spoken(c.rival)} (p = {c.adjusted:.2g})" for c in tests if c.adjusted <= SIGNIFICANT)
    return f"Differences in Score that are significant at {SIGNIFICANT:.0%}: {found or 'none'}."


def _against_chance(message: Interval, scene: Interval) -> str:
    """Compare with removing as many rows at random: who takes no more from the message has not found it."""
    doubt = "" if is_sure(message) else "No reliable effect. "
    if is_sure(message) and message.mean < 0:
        doubt = "No effect of its own. "
    less = f"From the message it takes {_more(message)} than removing as much at random, {how_sure(message)}"
    return f"{doubt}{less}; from the scene {_more(scene)}."


def _more(difference: Interval) -> str:
    return f"{db(difference)} more" if difference.mean >= 0 else f"{db(mirrored(difference))} less"


def _best(scores: Sequence[Contest]) -> str:
    better = sorted((c for c in scores if c.difference.mean <= -EQUAL), key=lambda c: c.difference.mean)
    equal = listed(spoken(c.rival) for c in scores if abs(c.difference.mean) < EQUAL)
    as_well = f" As good on average, to {EQUAL:g} dB: {equal}." if equal else ""
    if not better:
        return f"By Score, none of {plural(len(scores), 'rival')} does better on average.{as_well}"
    names = listed(f"{spoken(c.rival)} by {db(mirrored(c.difference))}, {how_sure(c.difference)}" for c in better)
    return f"By Score, no. Better on average: {names}.{as_well}"


def _at(damage: float, contests: Sequence[Contest]) -> Iterator[str]:
    rows = [c for c in contests if c.damage == damage]
    if not rows:
        return
    strongest = min(rows, key=lambda c: c.difference.mean)
    if strongest.difference.mean >= 0:
        yield f"For {damage:g} dB of the scene none takes more from the message."
    else:
        name, more = spoken(strongest.rival), mirrored(strongest.difference)
        yield f"For {damage:g} dB of the scene {name} takes {db(more)} more, {how_sure(more)}."
