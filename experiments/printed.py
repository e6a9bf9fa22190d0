"""The paper's printed numbers (Huang et al. 2026) as data: references beside our own results, and input of a check.

``printed/tables.csv`` holds Tables 1 to 3, with an asterisk where a number is bold; ``printed/claims.csv`` the numbers
of the text that follow from them. The numbers are references, never targets.
"""

import csv
from collections.abc import Callable, Mapping, Sequence
from math import nan
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gspure.evaluation.identity import Condition, OfCondition
from gspure.evaluation.results import Result
from gspure.grouping import grouped
from gspure.metrics.csv_tables import read_table
from gspure.metrics.names import GSPURE, UNATTACKED, display_name
from gspure.metrics.statistics import Cells, Interval, differences, mean_interval, scene_means
from gspure.metrics.targets import MESSAGE, SCENE

SCHEMES: Final = ("splats_in_splats", "gs_hider", "secure_gs")
ATTACKS: Final = ("random_pruning", "feature_scaling", "gaussian_noise", "gof", "gspure")
TARGETS: Final = (SCENE, MESSAGE)
PSNR: Final = "psnr"
SCORE: Final = "score"
ROUNDING: Final = 0.02  # dB: largest error of a Score, from four means rounded to 0.01 dB each
DATA: Final = Path(__file__).parent / "printed"

Means = Mapping[tuple[str, str, str], float]  # PSNR by scheme, variant and target, mean over scenes


class PrintedRow(NamedTuple):
    """One printed row of Tables 1 to 3."""

    table: int
    label: str  # in the paper
    scheme: str
    variant: str  # an attack, `unattacked`, or a configuration of the ablation such as `opacity_weight`
    target: str  # `scene` or `message`; empty for a Score
    metric: str
    values: Mapping[str, float]  # dB, or an SSIM, by scene; the key `mean` is the mean over all nine scenes


def read_rows() -> list[PrintedRow]:
    """Return all rows of Tables 1 to 3."""
    with (DATA / "tables.csv").open(encoding="utf-8", newline="") as stream:
        header, *lines = csv.reader(stream)
    rows = []
    for table, label, scheme, variant, target, metric, *cells in lines:
        values = {scene: float(cell.removesuffix("*")) for scene, cell in zip(header[6:], cells, strict=True) if cell}
        rows.append(PrintedRow(int(table), label, scheme, variant, target, metric, values))
    return rows


def psnr_by_scene(rows: Sequence[PrintedRow], scheme: str, variant: str, target: str) -> Mapping[str, float]:
    """Return the PSNR of every scene in Table 1."""
    wanted = (1, scheme, variant, target, PSNR)
    return next(r.values for r in rows if (r.table, r.scheme, r.variant, r.target, r.metric) == wanted)


def mean_psnr(rows: Sequence[PrintedRow]) -> dict[tuple[str, str, str], float]:
    """Return the mean PSNR over the nine scenes, from Table 1; for ablations, as Tables 2 and 3 print it."""
    psnr = [r for r in reversed(rows) if r.metric == PSNR]  # rows of Table 1 last: Tables 2 and 3 repeat GSPure's
    return {(r.scheme, r.variant, r.target): float(np.mean([*r.values.values()])) for r in psnr}


def drop(means: Means, scheme: str, variant: str, target: str) -> float:
    """Return the drop of a mean PSNR from that of the unattacked model, dB."""
    return means[scheme, UNATTACKED, target] - means[scheme, variant, target]


def score(means: Means, scheme: str, variant: str, _target: str = "") -> float:
    r"""Return :math:`\Delta PSNR_{message} - \Delta PSNR_{scene}`; the Score of the means is the mean of the Scores."""
    return drop(means, scheme, variant, MESSAGE) - drop(means, scheme, variant, SCENE)


def lead(means: Means, scheme: str, variant: str, target: str) -> float:
    """Return the lowest mean PSNR of the other attacks minus the mean PSNR of this attack, dB."""
    others = [means[scheme, attack, target] for attack in ATTACKS if attack != variant]
    return min(others) - means[scheme, variant, target]


def score_lead(means: Means, scheme: str, variant: str, _target: str = "") -> float:
    """Return a Score minus the highest Score of the other attacks, dB."""
    others = [score(means, scheme, attack) for attack in ATTACKS if attack != variant]
    return score(means, scheme, variant) - max(others)


QUANTITIES: Final[Mapping[str, Callable[[Means, str, str, str], float]]] = {
    PSNR: lambda means, *row: means[row],
    **{function.__name__: function for function in (drop, score, lead, score_lead)},
}


def score_interval(rows: Sequence[PrintedRow], scheme: str, variant: str) -> Interval:
    """Return the mean Score of Table 1 with its interval over the nine scenes, which the paper does not print."""
    drops = {}
    for target in TARGETS:
        before = psnr_by_scene(rows, scheme, UNATTACKED, target)
        after = psnr_by_scene(rows, scheme, variant, target)
        drops[target] = {scene: before[scene] - psnr for scene, psnr in after.items()}
    return mean_interval([[drops[MESSAGE][scene] - drops[SCENE][scene]] for scene in drops[SCENE]])


class Claim(NamedTuple):
    """A printed number that follows from others."""

    place: str  # the table or paragraph
    words: str  # the row, or words of the text
    quantity: str  # one of `QUANTITIES`
    scheme: str  # empty if the paper refers to all schemes: the largest value counts
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
        return self.difference > 0 if self.claim.relation == "<" else abs(self.difference) <= ROUNDING


def check_claims(rows: Sequence[PrintedRow]) -> list[Check]:
    """Return the Scores of Table 1, GSPure's PSNR in Tables 2 and 3 and the numbers of the text, recomputed."""
    means = mean_psnr(rows)
    claims = [
        Claim("Table 1", r.label, SCORE, r.scheme, r.variant, "", "=", r.values["mean"])
        for r in rows
        if r.metric == SCORE and r.variant != UNATTACKED
    ]
    for r in rows:
        if r.table > 1 and r.metric == PSNR and r.variant == GSPURE:
            column = display_name(r.scheme) if r.table == 2 else r.target.title()
            words = f"{r.label}, {column} PSNR"
            claims.append(Claim(f"Table {r.table}", words, PSNR, r.scheme, r.variant, r.target, "=", r.values["mean"]))
    claims += read_table(DATA / "claims.csv", Claim)
    checks = []
    for claim in claims:
        recompute = QUANTITIES[claim.quantity]
        schemes = [claim.scheme] if claim.scheme else SCHEMES
        values = [recompute(means, scheme, claim.variant, claim.target) for scheme in schemes]
        checks.append(Check(claim, max(values)))
    return checks


class Beside(NamedTuple):
    """One attack: its means over the paper's nine scenes, and over our scenes of one condition."""

    condition: OfCondition
    variant: str
    paper_scene_drop: float  # dB, like the other drops and Scores
    paper_message_drop: float
    paper_score: float  # recomputed
    scenes: int = 0  # number of our scenes
    scene_drop: float = nan
    message_drop: float = nan
    score: float = nan


def beside(rows: Sequence[PrintedRow], results: Sequence[Result] = ()) -> list[Beside]:
    """Return every attack of Table 1 beside our results as published, for each of our conditions."""
    published = [row for row in results if row.extraction == MESSAGE]
    by_condition = grouped(published, lambda row: row.condition)
    compared = []
    for scheme in SCHEMES:
        for condition in [known for known in by_condition if known.scheme == scheme] or [Condition(scheme)]:
            by_variant = grouped(by_condition.get(condition, []), lambda row: row.variant)
            compared += [_beside(rows, condition, attack, by_variant) for attack in ATTACKS]
    return compared


def _beside(
    rows: Sequence[PrintedRow], condition: Condition, attack: str, ours: Mapping[str, Sequence[Result]]
) -> Beside:
    """Return one attack of Table 1 beside our results of one condition, by variant."""
    means = mean_psnr(rows)
    scene_drop = drop(means, condition.scheme, attack, SCENE)
    message_drop = drop(means, condition.scheme, attack, MESSAGE)
    row = Beside(
        condition=condition,
        variant=attack,
        paper_scene_drop=scene_drop,
        paper_message_drop=message_drop,
        paper_score=message_drop - scene_drop,
    )
    attacked = ours.get(attack, ())
    message_drops = differences(_message_psnrs(ours.get(UNATTACKED, ())), _message_psnrs(attacked))
    if not message_drops:
        return row
    damages = {(one.scene, one.seed): one.damage for one in attacked}
    our_message_drop = _mean(message_drops)
    our_scene_drop = _mean({cell: damages[cell] for cell in message_drops})
    return row._replace(
        scenes=len(scene_means(message_drops)),
        scene_drop=our_scene_drop,
        message_drop=our_message_drop,
        score=our_message_drop - our_scene_drop,
    )


def _message_psnrs(results: Sequence[Result]) -> Cells:
    """Return the message's PSNR by scene and seed, where it is known."""
    return {(one.scene, one.seed): one.message_values[PSNR] for one in results if one.message_values}


def _mean(cells: Cells) -> float:
    """Return the mean over scenes of the means over their seeds."""
    return float(np.mean([*scene_means(cells).values()]))
