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
    if any(not isnan(c.damage) for c in contests):
        yield "At equal damage", _at_equal_damage(contests)


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
    everywhere = [c for c in better if _is_everywhere(c)]
    names = listed(f"{spoken(c.rival)} by {db(mirrored(c.difference))}" for c in everywhere)
    found = f"By Score, no. Better {how_sure(everywhere[0].difference)}: {names}." if everywhere else ""
    others = listed(spoken(c.rival) for c in better if not _is_everywhere(c))
    on_average = f" Better on average, {how_sure(better[-1].difference)}: {others}." if others else ""
    return f"{found or 'By Score, none does better everywhere.'}{on_average}{as_well}"


def _is_everywhere(contest: Contest) -> bool:
    return contest.difference.scenes == 1 or is_sure(contest.difference)


def _at_equal_damage(contests: Sequence[Contest]) -> str:
    """Return the attack that takes more than GSPure for the same damage, for every damage for which there is one."""
    found = []
    for damage in MATCHED_DAMAGES:
        stronger = [c for c in contests if c.damage == damage and c.difference.mean <= -EQUAL and _is_everywhere(c)]
        if stronger:
            most = min(stronger, key=lambda c: c.difference.mean)
            more = mirrored(most.difference)
            found.append(
                f"For {damage:g} dB of the scene {spoken(most.rival)} takes {db(more)} more, {how_sure(more)}."
            )
    least, largest = MATCHED_DAMAGES[0], MATCHED_DAMAGES[-1]
    return " ".join(found) or f"For {least:g} to {largest:g} dB of the scene none takes more everywhere."
