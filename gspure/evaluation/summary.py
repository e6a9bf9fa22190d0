"""Outcomes averaged over scenes: one row per condition, variant and extraction, as in the paper's Table 1."""

import math
from collections.abc import Sequence
from functools import partial
from operator import attrgetter
from typing import NamedTuple

from gspure.evaluation.identity import OfCondition
from gspure.evaluation.outcomes import Outcome, by_condition, extractions, mean_of
from gspure.evaluation.paper import TARGETS, mean_psnr, printed_scores, read_rows
from gspure.metrics.names import CLEAN_GSPURE, GSPURE
from gspure.metrics.statistics import Interval, known_interval
from gspure.metrics.targets import MESSAGE, SCENE


class Summary(NamedTuple):
    """One variant over the scenes of one condition; None if a number is unknown in every scene.

    The level of an interval is 0.95, or lower if so few scenes are known that the bounds are their smallest and largest
    values.
    """

    condition: OfCondition
    variant: str
    extraction: str  # the target that shows the message: `message`, or another way of extracting it
    scene: Interval | None  # PSNR of the scene, dB
    message: Interval | None  # PSNR of the message, dB, or the mean reading of a detector
    score: Interval | None
    retrieved: Interval | None  # share of views in which retrieval identifies the message
    paper_scene: float = math.nan  # like the next two, from the Tables 1 to 3: means over the paper's scenes
    paper_message: float = math.nan
    paper_score: float = math.nan


def summarize(outcomes: Sequence[Outcome]) -> list[Summary]:
    """Average over scenes and their seeds, in the order of `outcomes`.

    A scene in which a number is unknown does not count; the interval states how many do.
    """
    paper = read_rows()
    scores, psnr = printed_scores(paper), mean_psnr(paper)
    rows = []
    for condition, of_all in by_condition(outcomes).items():
        alike = _without_clean_assets(of_all)
        for variant in dict.fromkeys(o.variant for o in alike):
            scenes = [o for o in alike if o.variant == variant]
            printed = [psnr.get((condition.scheme, variant, target), math.nan) for target in TARGETS]
            printed.append(scores.get((condition.scheme, variant), math.nan))
            for extraction in extractions(alike) or [MESSAGE]:
                shown = [o for o in scenes if extraction in o.retrieval]
                means = (
                    mean_of(scenes, partial(Outcome.level, target=SCENE)),
                    mean_of(scenes, partial(Outcome.level, target=extraction)),
                    mean_of(scenes, partial(Outcome.score_of, target=extraction)),
                    known_interval({(o.scene, o.seed): o.retrieval[extraction].top1 for o in shown}),
                )
                rows.append(Summary(condition, variant, extraction, *means, *printed * (extraction == MESSAGE)))
    return rows


class Specificity(NamedTuple):
    """What GSPure prunes, and what it costs the scene: the marked models of one condition, and their clean models."""

    condition: OfCondition
    pruned: Interval | None  # share of the rows
    scene_drop: Interval | None  # dB
    clean_pruned: Interval | None
    clean_scene_drop: Interval | None


def specificity(outcomes: Sequence[Outcome]) -> list[Specificity]:
    """Return the conditions in which clean models were pruned, too."""
    rows = []
    for condition, alike in by_condition(outcomes).items():
        marked, clean = ([o for o in alike if o.variant == name] for name in (GSPURE, CLEAN_GSPURE))
        drop = partial(Outcome.psnr_drop, target=SCENE)
        means = [mean_of(of, value) for of in (marked, clean) for value in (attrgetter("pruned_share"), drop)]
        rows += [Specificity(condition, *means)] * bool(clean)
    return rows


def _without_clean_assets(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Leave out the models that no detector reads beside others that one reads: they are controls, not scenes."""
    read = {o.folder for o in outcomes if o.messages or o.failures}
    return [o for o in outcomes if o.folder in read or not any(other.detections for other in outcomes)]
