"""Outcomes averaged over scenes: one row per condition, variant and extraction, as in the paper's Table 1."""

import math
from collections.abc import Sequence
from functools import partial
from operator import attrgetter
from typing import NamedTuple

from gspure.evaluation.identity import Condition, OfCondition
from gspure.evaluation.outcomes import Outcome, by_condition, extractions, mean_of
from gspure.evaluation.paper import mean_psnr, printed_scores, read_rows
from gspure.metrics.names import CLEAN_GSPURE, GSPURE
from gspure.metrics.statistics import Interval, known_interval
from gspure.metrics.targets import MESSAGE, SCENE


class Summary(NamedTuple):
    """One variant over the scenes of one condition; None if a number is unknown in every scene.

    An interval has the level 0.95. With fewer than six known scenes, its level is lower and its bounds are their
    smallest and largest values.
    """

    condition: OfCondition
    variant: str
    extraction: str  # the target that shows the message: `message`, or another way of extracting it
    scene: Interval | None  # PSNR of the scene, dB
    message: Interval | None  # PSNR of the message, dB, or the mean reading of a detector
    score: Interval | None
    retrieved: Interval | None  # share of views in which retrieval identifies the message
    paper_scene: float = math.nan  # means over the paper's scenes, from its Tables 1 to 3, like the next two
    paper_message: float = math.nan
    paper_score: float = math.nan


def summarize(outcomes: Sequence[Outcome]) -> list[Summary]:
    """Average over scenes and their seeds, in the order of `outcomes`.

    A scene in which a number is unknown does not count; the interval states the number of scenes that do.
    """
    paper = read_rows()
    scores = printed_scores(paper)
    psnr = mean_psnr(paper)
    rows = []
    for condition, all_alike in by_condition(outcomes).items():
        alike = _without_unread_models(all_alike)
        for variant in dict.fromkeys(o.variant for o in alike):
            of_variant = [o for o in alike if o.variant == variant]
            for extraction in extractions(alike) or [MESSAGE]:
                row = _summary(condition, of_variant, extraction)
                if extraction == MESSAGE:
                    row = row._replace(
                        paper_scene=psnr.get((condition.scheme, variant, SCENE), math.nan),
                        paper_message=psnr.get((condition.scheme, variant, MESSAGE), math.nan),
                        paper_score=scores.get((condition.scheme, variant), math.nan),
                    )
                rows.append(row)
    return rows


def _summary(condition: Condition, outcomes: Sequence[Outcome], extraction: str) -> Summary:
    """Return the means of the outcomes of one variant, without the paper's."""
    top1 = {(o.scene, o.seed): o.retrieval[extraction].top1 for o in outcomes if extraction in o.retrieval}
    return Summary(
        condition=condition,
        variant=outcomes[0].variant,
        extraction=extraction,
        scene=mean_of(outcomes, partial(Outcome.level, target=SCENE)),
        message=mean_of(outcomes, partial(Outcome.level, target=extraction)),
        score=mean_of(outcomes, partial(Outcome.score_of, target=extraction)),
        retrieved=known_interval(top1),
    )


class Specificity(NamedTuple):
    """What GSPure prunes and costs the scene, in the marked models of one condition and in their clean models."""

    condition: OfCondition
    pruned: Interval | None  # share of the rows
    scene_drop: Interval | None  # dB
    clean_pruned: Interval | None
    clean_scene_drop: Interval | None


def specificity(outcomes: Sequence[Outcome]) -> list[Specificity]:
    """Return one row for each condition in which clean models were pruned, too."""
    pruned_share = attrgetter("pruned_share")
    scene_drop = partial(Outcome.psnr_drop, target=SCENE)
    rows = []
    for condition, alike in by_condition(outcomes).items():
        marked = [o for o in alike if o.variant == GSPURE]
        clean = [o for o in alike if o.variant == CLEAN_GSPURE]
        if clean:
            row = Specificity(
                condition=condition,
                pruned=mean_of(marked, pruned_share),
                scene_drop=mean_of(marked, scene_drop),
                clean_pruned=mean_of(clean, pruned_share),
                clean_scene_drop=mean_of(clean, scene_drop),
            )
            rows.append(row)
    return rows


def _without_unread_models(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Leave out models that no detector reads if detectors read others: they are controls, not scenes."""
    if not any(o.detections for o in outcomes):
        return [*outcomes]
    read = {o.model for o in outcomes if o.messages or o.failures}
    return [o for o in outcomes if o.model in read]
