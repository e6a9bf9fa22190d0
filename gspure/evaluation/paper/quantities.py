"""The quantities that the paper derives from its tables, recomputed."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np

from gspure.evaluation.intervals import Interval, mean_interval
from gspure.evaluation.metrics import rms_ratio
from gspure.evaluation.names import UNATTACKED
from gspure.evaluation.outcomes import MESSAGE, SCENE
from gspure.evaluation.paper.cells import ATTACKS, PSNR, SCORE, TARGETS, Cell

Means = Mapping[tuple[str, str, str], float]  # PSNR by scheme, variant and target, mean over scenes


def by_scene(cells: Sequence[Cell], scheme: str, variant: str, target: str) -> dict[str, float]:
    """Return the PSNR of every scene in Table 1."""
    row = (1, scheme, variant, target, PSNR)
    return {c.scene: c.value for c in cells if (c.table, c.scheme, c.variant, c.target, c.metric) == row}


def table_1(cells: Sequence[Cell]) -> dict[tuple[str, str, str], float]:
    """Return the means over the nine scenes of Table 1."""
    rows = {(c.scheme, c.variant, c.target) for c in cells if c.table == 1 and c.metric == PSNR}
    return {row: float(np.mean([*by_scene(cells, *row).values()])) for row in rows}


def ablations(cells: Sequence[Cell]) -> dict[tuple[str, str, str], float]:
    """Return the means of Tables 2 and 3, which repeat those of GSPure."""
    return {(c.scheme, c.variant, c.target): c.value for c in cells if c.table > 1 and c.metric == PSNR}


def printed_scores(cells: Sequence[Cell]) -> dict[tuple[str, str], float]:
    """Return the last column of Table 1, by scheme and variant."""
    return {(c.scheme, c.variant): c.value for c in cells if c.metric == SCORE}


def psnr(means: Means, scheme: str, variant: str, target: str) -> float:
    """Return a mean PSNR, dB."""
    return means[scheme, variant, target]


def drop(means: Means, scheme: str, variant: str, target: str) -> float:
    """Return the drop of a mean PSNR from that of the unattacked model, dB."""
    return means[scheme, UNATTACKED, target] - means[scheme, variant, target]


def score(means: Means, scheme: str, variant: str, _target: str = "") -> float:
    r"""Return :math:`\Delta PSNR_{message} - \Delta PSNR_{scene}`; the Score of the means is the mean of the Scores."""
    return drop(means, scheme, variant, MESSAGE) - drop(means, scheme, variant, SCENE)


def lead(means: Means, scheme: str, variant: str, target: str) -> float:
    """Return the lowest mean PSNR of the other attacks minus that of this one, dB."""
    others = [means[scheme, attack, target] for attack in ATTACKS if attack != variant]
    return min(others) - means[scheme, variant, target]


def score_lead(means: Means, scheme: str, variant: str, _target: str = "") -> float:
    """Return a Score minus the highest of the other attacks, dB."""
    return score(means, scheme, variant) - max(score(means, scheme, attack) for attack in ATTACKS if attack != variant)


QUANTITIES: Final[Mapping[str, Callable[[Means, str, str, str], float]]] = {
    "psnr": psnr,
    "drop": drop,
    "score": score,
    "lead": lead,
    "score_lead": score_lead,
}


def rms_ratio_of(cells: Sequence[Cell], scheme: str, variant: str) -> float:
    """Return the damage to the message relative to that of the scene over the nine scenes of Table 1."""
    psnr = {t: [[*by_scene(cells, scheme, v, t).values()] for v in (UNATTACKED, variant)] for t in TARGETS}
    return rms_ratio(np.transpose(psnr[MESSAGE]), np.transpose(psnr[SCENE]))


def score_interval(cells: Sequence[Cell], scheme: str, variant: str) -> Interval:
    """Return the mean Score of Table 1 with its interval over the nine scenes, which the paper does not print."""
    before, after = ({t: by_scene(cells, scheme, v, t) for t in TARGETS} for v in (UNATTACKED, variant))
    drops = {t: {scene: before[t][scene] - after[t][scene] for scene in after[t]} for t in TARGETS}
    return mean_interval([[drops[MESSAGE][scene] - drops[SCENE][scene]] for scene in drops[SCENE]])
