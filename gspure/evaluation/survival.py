"""Survival of the message after each attack: its margin above the negative controls of its scene."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gspure.evaluation.matched import reached_damage, reached_name
from gspure.evaluation.identity import OfCondition
from gspure.evaluation.outcomes import Outcome, by_condition, cells, extractions, mean_of
from gspure.grouping import grouped
from gspure.metrics.image_metrics import MARGIN, rms_ratio
from gspure.metrics.names import CLEAN, LEVEL_CONTROLS, MESSAGE_FREE, OTHER_SCENE, UNATTACKED, WRONG_KEY
from gspure.metrics.statistics import (
    LEVEL,
    Cells,
    Detectability,
    Interval,
    detectability,
    differences,
    known_interval,
    scene_means,
)
from gspure.metrics.targets import MESSAGE, SCENE, is_picture
from gspure.text import decimal


class Survival(NamedTuple):
    """One variant over the scenes of one condition; None if a number is unknown in every scene."""

    condition: OfCondition
    extraction: str  # the target that shows the message, or a detector
    variant: str
    present: int  # number of scenes in which the message of the unattacked model is present
    survived: int  # number of these in which it is present after the attack
    only_retrieved: int  # number of these in which it is not present, but retrieved, unlike from control models
    reached: bool | None  # whether the attack changed the extraction's carrier, or its result, in any scene
    message_drop: Interval | None  # like all means below, over the `present` scenes, or without any, over all
    scene_drop: Interval | None
    region_drop: Interval | None  # of the message's PSNR without its background (`region_psnr`)
    ms_ssim_drop: Interval | None
    nc_drop: Interval | None  # drop of the normalized correlation
    rms_ratio: float  # damage to the message divided by that to the scene (`gspure.metrics.image_metrics.rms_ratio`)
    above_floor: Interval | None  # the message's PSNR, or a detector's mean reading, minus the control level
    share_left: Interval | None  # `above_floor` divided by its value before the attack; None if no scene is `present`
    region_left: Interval | None  # the same of the message's PSNR without its background
    above_wrong_key: Interval | None  # the message's PSNR minus that of a wrong key applied to the unattacked model, dB
    control: str  # the kind of control model with the lowest AUC; empty if there is none
    detectability: Detectability | None  # AUC against that kind, with one value per scene
    damage: Interval | None  # of searched strengths, if the drop of a scene is unknown: what the search reached there

    @property
    def name(self) -> str:
        """The variant's display name, with the damage that its search reached if it misses the wanted one."""
        name, drop = reached_name(self.variant), self.damage or self.scene_drop
        named = reached_name(self.variant, *((drop.low, drop.high) if drop else ()))
        if drop and drop.level >= LEVEL and named != name:
            return f"{name} ({decimal(drop.mean)} dB reached on average)"
        return named

    @property
    def scenes(self) -> int:
        """The number of scenes in which the attack was measured."""
        return max((known.scenes for known in (self.message_drop, self.above_floor) if known), default=0)


def survival(outcomes: Sequence[Outcome]) -> list[Survival]:
    """Return the survival of the message for every condition, extraction and variant that is not a control.

    Conditions and variants keep the order of `outcomes`. Another scene's model in which the mark is detected is no
    control.
    """
    rows = []
    for alike in by_condition(outcomes).values():
        for extraction in extractions(alike):
            known = [o for o in alike if not (o.variant == OTHER_SCENE and _detected([o], extraction))]
            attacked = dict.fromkeys(o.variant for o in known if not o.is_control and extraction in o.messages)
            rows += [_survival(known, variant, extraction) for variant in attacked]
    return rows


def control_levels(outcomes: Iterable[Outcome]) -> Cells:
    """Return the highest PSNR, dB, of the controls of every scene and seed that do not hold its message."""
    return _highest(_levels(outcomes, MESSAGE))


def _levels(outcomes: Iterable[Outcome], target: str, metric: str = "psnr") -> dict[str, Cells]:
    """Return the level of a target by variant or control, and by scene and seed; ∞ where all views are exact."""
    by_variant = grouped(outcomes, lambda o: o.variant)
    return {variant: cells(alike, lambda o: o.level(target, metric)) for variant, alike in by_variant.items()}


def not_embedded(outcomes: Sequence[Outcome]) -> list[tuple[str, str]]:
    """Return scheme and folder of the models whose message is flat, not present or not retrieved before any attack."""
    absent = []
    for alike in by_condition(outcomes).values():
        control_level = control_levels(alike)
        for o in (o for o in alike if o.variant == UNATTACKED and MESSAGE in o.targets):
            above = o.targets[MESSAGE].psnr - control_level.get((o.scene, o.seed), -math.inf)
            retrieval = o.retrieval.get(MESSAGE)
            is_missed = bool(retrieval and retrieval.decides and not retrieval.succeeds)
            if o.is_flat(MESSAGE) or above < MARGIN or is_missed:
                absent.append((o.scheme, o.folder))
    return absent


def _highest(levels: Mapping[str, Cells]) -> Cells:
    controls = [levels.get(control, {}) for control in LEVEL_CONTROLS]
    return {cell: max(level[cell] for level in controls if cell in level) for cell in sorted(set().union(*controls))}


def _survival(alike: Sequence[Outcome], variant: str, extraction: str) -> Survival:
    levels, is_shown = _levels(alike, extraction), is_picture(extraction)
    known = [o for o in alike if extraction in o.messages]
    attacked, unattacked = ([o for o in known if o.variant == name] for name in (variant, UNATTACKED))
    before, after, control_level = levels.get(UNATTACKED, {}), levels.get(variant, {}), _highest(levels)
    if is_shown:
        tried = {o.scene for o in unattacked if extraction in o.retrieval and o.retrieval[extraction].decides}
        present = _present(before, control_level) - (tried - _retrieved(unattacked, extraction))
        survived = present & _present(after, control_level)
    else:
        present = _detected(unattacked, extraction) - doubtful_scenes(known, extraction)
        survived = present & _detected(attacked, extraction)
    lost = present & {o.scene for o in attacked} - survived
    message_free = [o for o in known if o.variant in MESSAGE_FREE]  # whose key may hold what retrieval identifies
    traces = lost & _retrieved(attacked, extraction) - _retrieved(message_free, extraction)
    attacked = [o for o in attacked if o.scene in present or not present]
    after = {cell: level for cell, level in after.items() if cell[0] in present or not present}
    reached = [changed for o in attacked if (changed := o.reaches(extraction)) is not None]
    # Kinds of controls are compared separately: those of one scene share its photographs, so they are not independent.
    groups = {kind: _scene_levels(after, levels.get(kind, {}), extraction) for kind in MESSAGE_FREE}
    auc = {kind: detectability(*both) for kind, both in groups.items() if all(both)}
    hardest = min(auc, key=lambda kind: auc[kind].auc, default="")
    regions = _levels(alike, extraction, "region") if is_shown else {}
    is_known = all(math.isfinite(o.psnr_drop(SCENE)) for o in attacked)
    return Survival(
        condition=alike[0].condition,
        extraction=extraction,
        variant=variant,
        present=len(lost | survived),
        survived=len(survived),
        only_retrieved=len(traces),
        reached=any(reached) if reached else None,
        message_drop=mean_of(attacked, lambda o: o.drop(extraction)),
        scene_drop=mean_of(attacked, lambda o: o.drop(SCENE)),
        region_drop=mean_of(attacked, lambda o: o.drops(extraction)["region"]),
        ms_ssim_drop=mean_of(attacked, lambda o: o.drops(extraction)["ms_ssim"]),
        nc_drop=mean_of(attacked, lambda o: o.drops(extraction)["nc"]),
        rms_ratio=_rms_ratio(variant, {**levels, variant: after}, _levels(alike, SCENE)) if is_shown else math.nan,
        above_floor=known_interval(differences(after, control_level)),
        share_left=known_interval(_shares_left(levels, variant, present)),
        region_left=known_interval(_shares_left(regions, variant, present)),
        above_wrong_key=known_interval(differences(after, levels.get(WRONG_KEY, {}))),
        control=hardest,
        detectability=auc.get(hardest),
        damage=None if is_known else mean_of(attacked, reached_damage),
    )


def _scene_levels(attacked: Cells, control: Cells, extraction: str) -> tuple[list[float], list[float]]:
    """Return the levels by scene after an attack and of a control; readings only of scenes with both.

    Scores of different scenes are not exchangeable, so a scene without its own control is compared with none.
    """
    both = [scene_means(attacked), scene_means(control)]
    common = both[0].keys() & both[1].keys()
    first, second = ([m for scene, m in means.items() if is_picture(extraction) or scene in common] for means in both)
    return first, second


def _rms_ratio(variant: str, message: Mapping[str, Cells], scene: Mapping[str, Cells]) -> float:
    tables = [target.get(name, {}) for target in (message, scene) for name in (UNATTACKED, variant)]
    cells = set.intersection(*({cell for cell in table if math.isfinite(table[cell])} for table in tables))
    columns = [[*scene_means({cell: table[cell] for cell in cells}).values()] for table in tables]
    return rms_ratio(np.transpose(columns[:2]), np.transpose(columns[2:]))


def _shares_left(levels: Mapping[str, Cells], variant: str, present: set[str]) -> Cells:
    """Return the share left in each `present` scene, from means over seeds, as cells with one seed."""
    before, after, control_level = levels.get(UNATTACKED, {}), levels.get(variant, {}), _highest(levels)
    known = before.keys() & after.keys() & control_level.keys()
    level = {cell: control_level[cell] for cell in known if cell[0] in present}
    whole, left = (scene_means(differences(psnr, level)) for psnr in (before, after))
    return {(scene, 0): max(0.0, left[scene]) / margin for scene, margin in whole.items() if 0 < margin < math.inf}


def _present(psnr: Cells, control_level: Cells) -> set[str]:
    """Return the scenes in which the mean over seeds lies `MARGIN` or more above the control level."""
    return {scene for scene, margin in scene_means(differences(psnr, control_level)).items() if margin >= MARGIN}


def _retrieved(outcomes: Iterable[Outcome], extraction: str) -> set[str]:
    """Return the scenes in which retrieval identifies the message with some seed."""
    return {o.scene for o in outcomes if extraction in o.retrieval and o.retrieval[extraction].succeeds}


def doubtful_scenes(outcomes: Sequence[Outcome], detector: str) -> set[str]:
    """Return the scenes in which detection tells nothing, since the detector also detects the mark in a clean model.

    If it does so in any scene, it may do so in those without a clean model, too.
    """
    clean = [o for o in outcomes if o.variant == CLEAN and detector in o.detections]
    detected = _detected(clean, detector)
    unchecked = {o.scene for o in outcomes} - {o.scene for o in clean} if detected else set()
    return detected | unchecked


def _detected(outcomes: Sequence[Outcome], detector: str) -> set[str]:
    """Return the scenes in which a detector detects the mark with some seed."""
    return {o.scene for o in outcomes if detector in o.detections and o.detections[detector].present}
