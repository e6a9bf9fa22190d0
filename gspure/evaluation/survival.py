"""Survival of the message after each attack: its margin above the negative controls of its scene."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gspure.evaluation.identity import ModelId, OfCondition
from gspure.evaluation.matched import title_with_damage
from gspure.evaluation.outcomes import Outcome, by_condition, cells, extractions, mean_of
from gspure.grouping import grouped
from gspure.metrics.image_metrics import MARGIN, rms_ratio
from gspure.metrics.names import CLEAN, LEVEL_CONTROLS, MESSAGE_FREE, OTHER_SCENE, UNATTACKED, WRONG_KEY, variant_title
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
    """One variant over the scenes of one condition; None if a number is unknown in every scene.

    Means are over the scenes in which the message is `present`; if it is in none, over all scenes.
    """

    condition: OfCondition
    extraction: str  # the target that shows the message, or a detector
    variant: str
    entry: str  # the variant\'s entry in the configuration, which several damages share
    wanted: float  # drop of the scene\'s PSNR for which the strength was searched, dB
    present: int  # number of scenes in which the message of the unattacked model is present
    survived: int  # number of these in which it is present after the attack
    only_retrieved: int  # number of these in which it is not present, but retrieved, and not from control models
    reached: bool | None  # whether the attack changed, in any scene, columns that the extraction reads, or its result
    message_drop: Interval | None
    scene_drop: Interval | None
    region_drop: Interval | None  # drop of the message's PSNR without its background (`region_psnr`)
    ms_ssim_drop: Interval | None
    nc_drop: Interval | None  # drop of the normalized correlation
    rms_ratio: float  # damage to the message divided by that to the scene (`gspure.metrics.image_metrics.rms_ratio`)
    above_floor: Interval | None  # the message's PSNR, or a detector's mean reading, minus the control level
    share_left: Interval | None  # `above_floor` divided by its value before the attack; None if no scene is `present`
    region_left: Interval | None  # `share_left` of the message's PSNR without its background
    above_wrong_key: Interval | None  # the message's PSNR minus that of a wrong key applied to the unattacked model, dB
    control: str  # the kind of control model with the lowest AUC; empty if there is none
    detectability: Detectability | None  # AUC against that kind, with one value per scene
    damage: Interval | None  # damage that the search for a strength reached; None if the drop of every scene is known

    @property
    def title(self) -> str:
        """The variant's display name."""
        return variant_title(self.entry, self.wanted)

    @property
    def name(self) -> str:
        """The variant's display name, with the damage that its search reached if it misses the wanted one."""
        title = self.title
        damage = self.damage or self.scene_drop
        if damage is None:
            return title
        title_with_range = title_with_damage(title, self.wanted, damage.low, damage.high)
        if damage.level >= LEVEL and title_with_range != title:
            return f"{title} ({decimal(damage.mean)} dB reached on average)"
        return title_with_range

    @property
    def scenes(self) -> int:
        """The number of scenes in which the attack was measured."""
        return max((known.scenes for known in (self.message_drop, self.above_floor) if known), default=0)


def survival(outcomes: Sequence[Outcome]) -> list[Survival]:
    """Return the survival of the message for every condition, extraction and variant that is not a control.

    Conditions and variants keep the order of `outcomes`. Another scene's model is no control if the mark is detected in
    it.
    """
    rows = []
    for alike in by_condition(outcomes).values():
        for extraction in extractions(alike):
            valid = [o for o in alike if not (o.variant == OTHER_SCENE and _detected([o], extraction))]
            variants = dict.fromkeys(o.variant for o in valid if not o.is_control and extraction in o.messages)
            rows += [_survival(valid, variant, extraction) for variant in variants]
    return rows


def control_levels(outcomes: Iterable[Outcome]) -> Cells:
    """Return the highest PSNR, dB, of the controls of every scene and seed that do not hold its message."""
    return _highest(_levels(outcomes, MESSAGE))


def _levels(outcomes: Iterable[Outcome], target: str, metric: str = "psnr") -> dict[str, Cells]:
    """Return the level of a target by variant or control, and by scene and seed; ∞ if all views are exact."""
    by_variant = grouped(outcomes, lambda o: o.variant)
    return {variant: cells(alike, lambda o: o.level(target, metric)) for variant, alike in by_variant.items()}


def not_embedded(outcomes: Sequence[Outcome]) -> list[ModelId]:
    """Return the models whose message is flat, not present or not retrieved before any attack."""
    absent = []
    for alike in by_condition(outcomes).values():
        control_level = control_levels(alike)
        for o in alike:
            if o.variant != UNATTACKED or MESSAGE not in o.targets:
                continue
            above = o.targets[MESSAGE].psnr - control_level.get((o.scene, o.seed), -math.inf)
            retrieval = o.retrieval.get(MESSAGE)
            is_missed = bool(retrieval and retrieval.decides and not retrieval.succeeds)
            if o.is_flat(MESSAGE) or above < MARGIN or is_missed:
                absent.append(o.model)
    return absent


def _highest(levels: Mapping[str, Cells]) -> Cells:
    """Return the highest level of `LEVEL_CONTROLS` by scene and seed."""
    controls = [levels.get(control, {}) for control in LEVEL_CONTROLS]
    measured = sorted(set().union(*controls))
    return {cell: max(level[cell] for level in controls if cell in level) for cell in measured}


def _survival(alike: Sequence[Outcome], variant: str, extraction: str) -> Survival:
    is_shown = is_picture(extraction)
    known = [o for o in alike if extraction in o.messages]
    attacked = [o for o in known if o.variant == variant]
    first = attacked[0]
    levels = _levels(alike, extraction)
    scene_levels = _levels(alike, SCENE)
    regions = _levels(alike, extraction, "region") if is_shown else {}
    before = levels.get(UNATTACKED, {})
    after = levels.get(variant, {})
    control_level = _highest(levels)
    present = _present_before(known, before, control_level, extraction)
    still_present = _above_controls(after, control_level) if is_shown else _detected(attacked, extraction)
    attacked_scenes = {o.scene for o in attacked}
    survived = present & still_present
    lost = (present & attacked_scenes) - survived
    message_free = [o for o in known if o.variant in MESSAGE_FREE]  # retrieval may identify a message in their key
    only_retrieved = (lost & _retrieved(attacked, extraction)) - _retrieved(message_free, extraction)
    judged_scenes = present or attacked_scenes
    judged = [o for o in attacked if o.scene in judged_scenes]
    judged_after = {cell: level for cell, level in after.items() if cell[0] in judged_scenes}
    hardest, auc = _hardest_control(judged_after, levels, extraction)
    is_known = all(math.isfinite(o.psnr_drop(SCENE)) for o in judged)
    scene_tables = (scene_levels.get(UNATTACKED, {}), scene_levels.get(variant, {}))
    return Survival(
        condition=alike[0].condition,
        extraction=extraction,
        variant=variant,
        entry=first.entry or variant,
        wanted=first.wanted,
        present=len(lost | survived),
        survived=len(survived),
        only_retrieved=len(only_retrieved),
        reached=_affected(judged, extraction),
        message_drop=mean_of(judged, lambda o: o.drop(extraction)),
        scene_drop=mean_of(judged, lambda o: o.drop(SCENE)),
        region_drop=mean_of(judged, lambda o: o.drops(extraction)["region"]),
        ms_ssim_drop=mean_of(judged, lambda o: o.drops(extraction)["ms_ssim"]),
        nc_drop=mean_of(judged, lambda o: o.drops(extraction)["nc"]),
        rms_ratio=_rms_ratio((before, judged_after), scene_tables) if is_shown else math.nan,
        above_floor=known_interval(differences(judged_after, control_level)),
        share_left=known_interval(_shares_left(levels, variant, present)),
        region_left=known_interval(_shares_left(regions, variant, present)),
        above_wrong_key=known_interval(differences(judged_after, levels.get(WRONG_KEY, {}))),
        control=hardest,
        detectability=auc,
        damage=None if is_known else mean_of(judged, lambda o: o.damage),
    )


def _affected(attacked: Sequence[Outcome], extraction: str) -> bool | None:
    """Return whether the attack affected the extraction in any scene; None if that is unknown in all scenes."""
    effects = [o.reaches(extraction) for o in attacked]
    known = [effect for effect in effects if effect is not None]
    return any(known) if known else None


def _hardest_control(attacked: Cells, levels: Mapping[str, Cells], extraction: str) -> tuple[str, Detectability | None]:
    """Return the kind of control model with the lowest AUC, and this AUC.

    Kinds are compared separately: the controls of one scene share its photographs, so they are not independent.
    """
    auc = {}
    for kind in MESSAGE_FREE:
        attacked_means, control_means = _scene_levels(attacked, levels.get(kind, {}), extraction)
        if attacked_means and control_means:
            auc[kind] = detectability(attacked_means, control_means)
    hardest = min(auc, key=lambda kind: auc[kind].auc, default="")
    return hardest, auc.get(hardest)


def _scene_levels(attacked: Cells, control: Cells, extraction: str) -> tuple[list[float], list[float]]:
    """Return the levels by scene after an attack and of a control; readings of a detector only of scenes with both.

    Scores of different scenes are not exchangeable, so a scene without its own control is compared with none.
    """
    attacked_means = scene_means(attacked)
    control_means = scene_means(control)
    if is_picture(extraction):
        return [*attacked_means.values()], [*control_means.values()]
    common = [scene for scene in attacked_means if scene in control_means]
    return [attacked_means[scene] for scene in common], [control_means[scene] for scene in common]


def _rms_ratio(message: tuple[Cells, Cells], scene: tuple[Cells, Cells]) -> float:
    """Return the `rms_ratio` of the PSNR before and after an attack, over scenes and seeds with four finite values."""
    tables = message + scene
    finite = [{cell for cell, psnr in table.items() if math.isfinite(psnr)} for table in tables]
    common = set.intersection(*finite)
    columns = [[*scene_means({cell: table[cell] for cell in common}).values()] for table in tables]
    return rms_ratio(np.transpose(columns[:2]), np.transpose(columns[2:]))


def _shares_left(levels: Mapping[str, Cells], variant: str, present: set[str]) -> Cells:
    """Return the share left in each `present` scene, from means over seeds, as cells with one seed."""
    before = levels.get(UNATTACKED, {})
    after = levels.get(variant, {})
    control_level = _highest(levels)
    known = before.keys() & after.keys() & control_level.keys()
    level = {cell: control_level[cell] for cell in known if cell[0] in present}
    margins_before = scene_means(differences(before, level))
    margins_after = scene_means(differences(after, level))
    return {
        (scene, 0): max(0.0, margins_after[scene]) / margin
        for scene, margin in margins_before.items()
        if 0 < margin < math.inf
    }


def _present_before(known: Sequence[Outcome], before: Cells, control_level: Cells, extraction: str) -> set[str]:
    """Return the scenes in which the message of the unattacked model is present, with its levels `before`."""
    unattacked = [o for o in known if o.variant == UNATTACKED]
    if not is_picture(extraction):
        return _detected(unattacked, extraction) - doubtful_scenes(known, extraction)
    decided = {o.scene for o in unattacked if extraction in o.retrieval and o.retrieval[extraction].decides}
    not_retrieved = decided - _retrieved(unattacked, extraction)
    return _above_controls(before, control_level) - not_retrieved


def _above_controls(psnr: Cells, control_level: Cells) -> set[str]:
    """Return the scenes in which the mean over seeds lies `MARGIN` or more above the control level."""
    return {scene for scene, margin in scene_means(differences(psnr, control_level)).items() if margin >= MARGIN}


def _retrieved(outcomes: Iterable[Outcome], extraction: str) -> set[str]:
    """Return the scenes in which retrieval identifies the message with some seed."""
    return {o.scene for o in outcomes if extraction in o.retrieval and o.retrieval[extraction].succeeds}


def doubtful_scenes(outcomes: Sequence[Outcome], detector: str) -> set[str]:
    """Return the scenes in which a detection proves nothing, since the detector also detects the mark in a clean model.

    If it does so in any scene, scenes without a clean model are doubtful, too.
    """
    clean = [o for o in outcomes if o.variant == CLEAN and detector in o.detections]
    detected = _detected(clean, detector)
    unchecked = {o.scene for o in outcomes} - {o.scene for o in clean} if detected else set()
    return detected | unchecked


def _detected(outcomes: Sequence[Outcome], detector: str) -> set[str]:
    """Return the scenes in which a detector detects the mark with some seed."""
    return {o.scene for o in outcomes if detector in o.detections and o.detections[detector].present}
