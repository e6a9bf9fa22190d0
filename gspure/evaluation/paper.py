"""The paper's printed numbers (Huang et al. 2026) as data: references beside our own results, and input of a check.

``paper.csv`` holds the cells of Tables 1 to 3, with an asterisk where they are bold; ``paper_claims.csv`` the numbers
of the text that follow from them. The numbers are references, never targets.
"""

import csv
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from math import nan
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gspure.evaluation.csv_tables import read_table
from gspure.evaluation.intervals import Interval, mean_interval
from gspure.evaluation.metrics import rms_ratio
from gspure.evaluation.names import GSPURE, UNATTACKED, display_name
from gspure.evaluation.outcomes import MESSAGE, SCENE, Condition, OfCondition
from gspure.evaluation.survival import Survival

SCHEMES: Final = ("splats_in_splats", "gs_hider", "secure_gs")
ATTACKS: Final = ("random_pruning", "feature_scaling", "gaussian_noise", "gof", "gspure")
TARGETS: Final = (SCENE, MESSAGE)
PSNR, SCORE = "psnr", "score"
ROUNDING: Final = 0.02  # dB: the error of a Score of four means that are rounded to 0.01 each
DATA: Final = Path(__file__).parent

Means = Mapping[tuple[str, str, str], float]  # PSNR by scheme, variant and target, mean over scenes


class Cell(NamedTuple):
    """One printed number."""

    table: int
    row: str  # its label in the paper, like that of the column
    column: str
    scheme: str
    variant: str  # an attack, `unattacked`, or a configuration of the ablation such as `opacity_weight`
    scene: str  # a scene, or `mean` over all nine
    target: str  # `scene` or `message`; empty for a Score
    metric: str
    value: float  # dB, or an SSIM


def read_cells() -> list[Cell]:
    """Return all cells of Tables 1 to 3, row by row."""
    with (DATA / "paper.csv").open(encoding="utf-8", newline="") as stream:
        rows = [*csv.DictReader(stream)]
    cells = []
    for _, alike in groupby(rows, key=lambda row: (row["table"], row["row"])):
        printed = [*alike]
        for scene in [*rows[0]][6:]:
            for row in (row for row in printed if row[scene]):
                where = (row["scheme"], row["variant"], scene, row["target"], row["metric"])
                number = float(row[scene].removesuffix("*"))
                cells.append(Cell(int(row["table"]), row["row"], _column(row, scene), *where, number))
    return cells


def _column(row: Mapping[str, str], scene: str) -> str:
    """Return the printed title of a cell's column."""
    if row["metric"] == SCORE:
        return "Score"
    if row["table"] == "1":
        return f"{scene} {row['target']}".title()
    return f"{display_name(row['scheme']) if row['table'] == '2' else row['target'].title()} {row['metric'].upper()}"


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
    PSNR: lambda means, *row: means[row],
    **{function.__name__: function for function in (drop, score, lead, score_lead)},
}


def rms_ratio_of(cells: Sequence[Cell], scheme: str, variant: str) -> float:
    """Return the damage to the message relative to that of the scene over the nine scenes of Table 1."""
    levels = {t: [[*by_scene(cells, scheme, v, t).values()] for v in (UNATTACKED, variant)] for t in TARGETS}
    return rms_ratio(np.transpose(levels[MESSAGE]), np.transpose(levels[SCENE]))


def score_interval(cells: Sequence[Cell], scheme: str, variant: str) -> Interval:
    """Return the mean Score of Table 1 with its interval over the nine scenes, which the paper does not print."""
    before, after = ({t: by_scene(cells, scheme, v, t) for t in TARGETS} for v in (UNATTACKED, variant))
    drops = {t: {scene: before[t][scene] - after[t][scene] for scene in after[t]} for t in TARGETS}
    return mean_interval([[drops[MESSAGE][scene] - drops[SCENE][scene]] for scene in drops[SCENE]])


class Claim(NamedTuple):
    """A printed number that follows from others."""

    place: str  # the table or paragraph
    words: str  # the row, or words of the text
    quantity: str  # one of `QUANTITIES`
    scheme: str  # empty if the paper refers to all schemes; then the largest value counts
    variant: str
    target: str
    relation: str  # `=`, or `<` if the paper gives a bound
    value: float


class Check(NamedTuple):
    """A claim, and the value that follows from Table 1."""

    claim: Claim
    recomputed: float

    @property
    def difference(self) -> float:
        """Printed minus recomputed, dB."""
        return self.claim.value - self.recomputed

    @property
    def holds(self) -> bool:
        """Whether the printed number follows from Table 1."""
        return self.difference > 0 if self.claim.relation == "<" else _equal(self.claim.value, self.recomputed)


def check_claims(cells: Sequence[Cell]) -> list[Check]:
    """Return the Scores of Table 1, GSPure's PSNR in Tables 2 and 3 and the numbers of the text, recomputed."""
    means = table_1(cells)
    claims = [
        Claim("Table 1", c.row, SCORE, c.scheme, c.variant, "", "=", c.value)
        for c in cells
        if c.metric == SCORE and c.variant != UNATTACKED
    ]
    claims += [
        Claim(f"Table {c.table}", f"{c.row}, {c.column}", PSNR, c.scheme, c.variant, c.target, "=", c.value)
        for c in cells
        if c.table > 1 and c.metric == PSNR and c.variant == GSPURE
    ]
    claims += read_table(DATA / "paper_claims.csv", Claim)
    return [Check(claim, _recompute(claim, means)) for claim in claims]


def _recompute(claim: Claim, means: Means) -> float:
    quantity = QUANTITIES[claim.quantity]
    return max(quantity(means, s, claim.variant, claim.target) for s in ([claim.scheme] if claim.scheme else SCHEMES))


def _equal(a: float, b: float) -> bool:
    return abs(a - b) <= ROUNDING


class Beside(NamedTuple):
    """One attack: means over the paper's nine scenes, its Score recomputed, and over ours of one condition."""

    condition: OfCondition
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
    """Return every attack of Table 1 beside ours, under every condition of ours for the paper's schemes.

    Ours count if the message was present in any scene.
    """
    ours = {(row.condition, row.variant): row for row in survivals if row.extraction == MESSAGE}
    conditions = dict.fromkeys(condition for condition, _ in ours)
    means, rows = table_1(cells), []
    for scheme in SCHEMES:
        for condition in [known for known in conditions if known.scheme == scheme] or [Condition(scheme)]:
            for attack in ATTACKS:
                scene, message = (drop(means, scheme, attack, target) for target in TARGETS)
                ratio = rms_ratio_of(cells, scheme, attack)
                printed = Beside(condition, attack, scene, message, message - scene, ratio)
                row = ours.get((condition, attack))
                if row and row.present and row.scene_drop and row.message_drop:
                    lost = (row.scene_drop.mean, row.message_drop.mean)
                    printed = printed._replace(scenes=row.message_drop.scenes, scene_drop=lost[0], message_drop=lost[1])
                    printed = printed._replace(score=lost[1] - lost[0], rms_ratio=row.rms_ratio)
                rows.append(printed)
    return rows
