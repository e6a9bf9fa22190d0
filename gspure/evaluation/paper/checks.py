"""Printed numbers against the values that follow from the cells of Table 1."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from gspure.evaluation.csv_tables import read_table
from gspure.evaluation.names import GSPURE, UNATTACKED
from gspure.evaluation.paper.cells import ATTACKS, DATA, PSNR, SCHEMES, SCORE, TARGETS, Cell
from gspure.evaluation.paper.quantities import QUANTITIES, Means, ablations, printed_scores, table_1

ROUNDING: Final = 0.02  # ours, dB: the error of a Score of four means that are rounded to 0.01 each


class Claim(NamedTuple):
    """A printed number that follows from others."""

    place: str  # the table or paragraph
    words: str  # the row, or words of the text
    quantity: str  # one of `gspure.evaluation.paper.quantities.QUANTITIES`
    scheme: str  # empty if the paper refers to all schemes; then the largest value counts
    variant: str
    target: str
    relation: str  # `=`, or `<` if the paper gives a bound
    value: float


class Check(NamedTuple):
    """A claim, and the value that follows from Table 1."""

    claim: Claim
    recomputed: float
    agrees_with: str  # another source that the printed number follows from, if the check fails; empty if none is known

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
        if c.metric == SCORE and c.variant != UNATTACKED
    ]
    repeated = [
        Claim(f"Table {c.table}", f"{c.row}, {c.column}", PSNR, c.scheme, c.variant, c.target, "=", c.value)
        for c in cells
        if c.table > 1 and c.metric == PSNR and c.variant == GSPURE
    ]
    return [*scores, *repeated, *read_table(DATA / "claims.csv", Claim)]


def check_claims(cells: Sequence[Cell]) -> list[Check]:
    """Return every claim with its recomputed value."""
    means = table_1(cells)
    checks = [Check(claim, _recompute(claim, means), "") for claim in read_claims(cells)]
    return [check if check.holds else check._replace(agrees_with=_agreement(check.claim, cells)) for check in checks]


def _recompute(claim: Claim, means: Means) -> float:
    quantity = QUANTITIES[claim.quantity]
    schemes = [claim.scheme] if claim.scheme else SCHEMES
    return max(quantity(means, scheme, claim.variant, claim.target) for scheme in schemes)


def _agreement(claim: Claim, cells: Sequence[Cell]) -> str:
    values = _other_sources(claim, cells) if claim.relation == "=" else ()
    return ", ".join(source for source, value in values if _equal(claim.value, value))


def _other_sources(claim: Claim, cells: Sequence[Cell]) -> Iterator[tuple[str, float]]:
    """Yield other sources of a printed number, with the value that follows from each."""
    means = table_1(cells)
    if claim.place not in {"Table 2", "Table 3"}:
        yield "GSPure's means in Tables 2 and 3", _recompute(claim, {**means, **ablations(cells)})
    for target in set(TARGETS) - {claim.target} if claim.target else ():
        yield f"the {claim.quantity} of the {target}", _recompute(claim._replace(target=target), means)
    if claim.quantity == "score_lead":
        scores = printed_scores(cells)
        best = max(scores[claim.scheme, attack] for attack in ATTACKS if attack != claim.variant)
        yield "the printed Scores", scores[claim.scheme, claim.variant] - best


def _equal(a: float, b: float) -> bool:
    return abs(a - b) <= ROUNDING
