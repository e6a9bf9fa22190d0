"""The attacks of the paper's Table 1 beside our own results."""

from collections.abc import Sequence
from math import nan
from typing import NamedTuple

from gspure.evaluation.outcomes import MESSAGE, SCENE, Condition, condition_of
from gspure.evaluation.paper.cells import ATTACKS, SCHEMES, Cell
from gspure.evaluation.paper.quantities import drop, rms_ratio_of, score, table_1
from gspure.evaluation.survival import Survival


class Beside(NamedTuple):
    """One attack: means over the paper's nine scenes, and over our scenes of one condition; NaN if unknown.

    The paper's Score is recomputed from its PSNR, since some of the printed ones do not follow from it.
    """

    scheme: str
    protocol: str
    initialization: str
    variant: str
    paper_scene_drop: float  # dB, like the other drops and Scores
    paper_message_drop: float
    paper_score: float
    paper_rms_ratio: float
    scenes: int = 0  # number of our scenes
    scene_drop: float = nan
    message_drop: float = nan
    score: float = nan
    rms_ratio: float = nan


def beside(cells: Sequence[Cell], survivals: Sequence[Survival] = ()) -> list[Beside]:
    """Return every attack of Table 1, under every condition of ours for the paper's schemes."""
    ours = {(condition_of(row), row.variant): row for row in survivals if row.extraction == MESSAGE}
    measured = dict.fromkeys(condition for condition, _ in ours)
    means = table_1(cells)
    return [
        _measured(
            Beside(
                *condition,
                attack,
                drop(means, scheme, attack, SCENE),
                drop(means, scheme, attack, MESSAGE),
                score(means, scheme, attack),
                rms_ratio_of(cells, scheme, attack),
            ),
            ours.get((condition, attack)),
        )
        for scheme in SCHEMES
        for condition in [known for known in measured if known.scheme == scheme] or [Condition(scheme)]
        for attack in ATTACKS
    ]


def _measured(printed: Beside, row: Survival | None) -> Beside:
    """Return a row with our numbers, if the message was present in any scene."""
    if row is None or not row.present or row.scene_drop is None or row.message_drop is None:
        return printed
    scene, message = row.scene_drop.mean, row.message_drop.mean
    ours = printed._replace(scenes=row.message_drop.scenes, scene_drop=scene, message_drop=message)
    return ours._replace(score=message - scene, rms_ratio=row.rms_ratio)
