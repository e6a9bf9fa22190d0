"""The tables of a scheme over all of its scenes, in the shape in which the page shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan

from gspure.evaluation.contest import MESSAGE_DROP, SCENE_DROP, SCORE, Contest
from gspure.evaluation.matched import Matched, by_extraction, most
from gspure.evaluation.outcomes import ordered
from gspure.evaluation.survival import Survival


@dataclass(frozen=True)
class Extraction:
    """What is known of one extraction of the message of one scheme."""

    name: str
    survivals: list[Survival]
    rivals: list[dict[str, Contest]]
    """For each rival as it was run, GSPure less it, by quantity."""

    equal: list[list[Contest]]
    """For each sweep, GSPure less it, by damage to the scene."""

    matched: list[list[Matched]]
    """For each sweep, what it takes, by damage to the scene."""

    @property
    def most(self) -> list[Matched]:
        """The cells of the sweeps that take the most from the message."""
        return most(self.matched)

    @property
    def has_controls(self) -> bool:
        """Whether any attack can be compared with controls."""
        return any(row.above_controls for row in self.survivals)


def extractions(
    scheme: str, survivals: Sequence[Survival], contests: Sequence[Contest], matched: Sequence[Matched]
) -> list[Extraction]:
    """Return the tables of a scheme, by extraction of its message."""
    sweeps = {name: table for _, name, table in by_extraction(row for row in matched if row.scheme == scheme)}
    left = [row for row in survivals if row.scheme == scheme]
    bouts = [c for c in contests if c.scheme == scheme]
    found = []
    for name in ordered({*sweeps, *(row.extraction for row in left), *(c.extraction for c in bouts)}):
        ours = [c for c in bouts if c.extraction == name]
        as_run, equal = [c for c in ours if isnan(c.damage)], [c for c in ours if not isnan(c.damage)]
        rivals = [{c.quantity: c for c in as_run if c.rival == rival} for rival in _rivals(as_run)]
        found.append(
            Extraction(
                name,
                [row for row in left if row.extraction == name],
                [rival for rival in rivals if rival.keys() == {SCORE, MESSAGE_DROP, SCENE_DROP}],
                [[c for c in equal if c.rival == rival] for rival in _rivals(equal)],
                sweeps.get(name, []),
            )
        )
    return found


def _rivals(contests: Sequence[Contest]) -> list[str]:
    return list(dict.fromkeys(c.rival for c in contests))
