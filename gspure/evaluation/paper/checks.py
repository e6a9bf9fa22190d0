"""Printed numbers against what follows from the cells of Table 1."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from gspure.evaluation.outcomes import REFERENCE
from gspure.evaluation.paper.cells import ATTACKS, PSNR, SCHEMES, SCORE, TARGETS, Cell, read_rows
from gspure.evaluation.paper.quantities import QUANTITIES, Means, ablations, printed_scores, table_1

ROUNDING: Final = 0.02
"""Ours, dB: a Score of four means that were rounded to 0.01 each can be off by this much."""

OURS: Final = "gspure"


class Claim(NamedTuple):
    """A printed number that follows from others."""

    place: str
    """The table or paragraph."""

    words: str
    """What is printed there: a row, or words of the text."""

    quantity: str
    """One of `gspure.evaluation.paper.quantities.QUANTITIES`."""

    scheme: str
    """Empty where the paper speaks of all schemes: then the largest value counts."""

    variant: str
    target: str
    relation: str
    """``=``, or ``<`` where the paper gives a bound."""

    value: float


class Check(NamedTuple):
    """A claim and what Table 1 says."""

    claim: Claim
    recomputed: float
    agrees_with: str
    """If it does not hold: from what else the printed number follows, empty if from nothing known."""

    @property
    def difference(self) -> float:
        """Printed minus recomputed, dB."""
        return self.claim.value - self.recomputed

    @property
    def holds(self) -> bool:
        """Whether the printed number follows from Table 1."""
        return self.difference > 0 if self.claim.relation == "<" else _equal(self.claim.value, self.recomputed)


def read_claims(cells: Sequence[Cell]) -> list[Claim]:
    """Return the Scores of Table 1, GSPure's PSNR in Tables 2 and 3, and the numbers of the text."""
    scores = [
        Claim(f"Table {c.table}", c.row, SCORE, c.scheme, c.variant, "", "=", c.value)
        for c in cells
        if c.metric == SCORE and c.variant != REFERENCE
    ]
    repeated = [
        Claim(f"Table {c.table}", f"{c.row}, {c.column}", PSNR, c.scheme, c.variant, c.target, "=", c.value)
        for c in cells
        if c.table > 1 and c.metric == PSNR and c.variant == OURS
    ]
    return [*scores, *repeated, *map(_claim, read_rows("claims.csv"))]


def check_claims(cells: Sequence[Cell]) -> list[Check]:
    """Return every claim with its recomputed value."""
    means = table_1(cells)
    found = [Check(claim, _recompute(claim, means), "") for claim in read_claims(cells)]
    return [check if check.holds else check._replace(agrees_with=_agreement(check.claim, cells)) for check in found]


def _claim(printed: dict[str, str]) -> Claim:
    place, words, quantity, scheme, variant, target, relation, value = printed.values()
    return Claim(place, words, quantity, scheme, variant, target, relation, float(value))


def _recompute(claim: Claim, means: Means) -> float:
    quantity = QUANTITIES[claim.quantity]
    schemes = [claim.scheme] if claim.scheme else SCHEMES
    return max(quantity(means, scheme, claim.variant, claim.target) for scheme in schemes)


def _agreement(claim: Claim, cells: Sequence[Cell]) -> str:
    values = _other_sources(claim, cells) if claim.relation == "=" else ()
    return ", ".join(source for source, value in values if _equal(claim.value, value))


def _other_sources(claim: Claim, cells: Sequence[Cell]) -> Iterator[tuple[str, float]]:
    """Yield where else the printed number may come from, and what it would be then."""
    means = table_1(cells)
    if claim.place not in {"Table 2", "Table 3"}:
        yield "GSPure's means in Tables 2 and 3", _recompute(claim, {**means, **ablations(cells)})
    for target in set(TARGETS) - {claim.target} if claim.target else ():
        yield f"the {claim.quantity} of the {target}", _recompute(claim._replace(target=target), means)
    if claim.quantity == "score_lead":
        scores = printed_scores(cells)
        best = max(scores[claim.scheme, other] for other in ATTACKS if other != claim.variant)
        yield "the printed Scores", scores[claim.scheme, claim.variant] - best


def _equal(a: float, b: float) -> bool:
    return abs(a - b) <= ROUNDING
