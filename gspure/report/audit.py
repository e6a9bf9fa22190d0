"""The owner's audit under one condition: which attacks the message survives, at what cost, and how certain that is.

This module gathers the facts; ``templates/audit.html.j2`` puts them into words.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, isnan
from typing import Final, Literal, NamedTuple

from gspure.evaluation.contest import SCORE, Contest
from gspure.evaluation.controls import CLEAN, CONTROLS, MESSAGE_FREE, OTHER_SCENE
from gspure.evaluation.csv_tables import grouped
from gspure.evaluation.intervals import Interval, by_scene, known_interval, mean_interval
from gspure.evaluation.matched import reached_names
from gspure.evaluation.names import GSPURE, UNATTACKED
from gspure.evaluation.outcomes import (
    BITS,
    MESSAGE,
    SCENE,
    Condition,
    Outcome,
    by_condition,
    condition_of,
    is_picture,
    ordered,
)
from gspure.evaluation.summary import Summary, summarize
from gspure.evaluation.survival import Survival, doubtful_scenes
from gspure.evaluation.tradeoff import DAMAGE_TOLERANCE, MATCHED_DAMAGES

RANDOM: Final = "random_matched"
"""The attack that removes as many rows as GSPure, at random: GSPure has an effect only if it does better."""

SIGNIFICANT: Final = 0.05

ALLOWED: Final = MATCHED_DAMAGES[-1]  # largest damage to the scene of an attack that counts for the verdict, dB
EQUAL: Final = 0.05  # mean differences below this count as zero, dB: the page shows tenths

Verdict = Literal[
    "judged", "failed", "no key", "no survival", "no reference", "no controls", "not present", "not touched"
]


class OtherAttacks(NamedTuple):
    """GSPure against all other attacks under one condition."""

    attacks: int
    scenes: int  # number of scenes in the largest comparison
    ahead: list[Contest]  # those with a higher Score, the best first
    level: list[Contest]  # those with the same Score
    ahead_at_equal_damage: list[Contest]  # by damage, the best attack, if consistently better than GSPure
    damages: list[float]  # the damages at which GSPure and another attack were tested, dB
    scenes_at_damages: int  # number of scenes in the largest comparison at such a damage
    significant: list[Contest]
    p_attainable: float  # the smallest p that any of the differences in Score could have


class OffPath(NamedTuple):
    """How far GSPure lowers the PSNR of message and scene, on and off the camera path, dB."""

    message: Interval
    scene: Interval
    message_on_path: Interval
    scene_on_path: Interval


class Failure(NamedTuple):
    """Variants that failed for the same reason."""

    reason: str
    variants: list[str]  # their display names, or those of detectors of variants
    models: int


@dataclass(frozen=True)
class Audit:
    """The findings for one scheme, protocol and initialization."""

    condition: Condition
    extraction: str  # the extraction that is judged: the scheme's own or, without one, a detector
    scenes: int
    unknown: int  # number of these in which presence of the mark is unknown: too few views, or no clean model
    unchecked: dict[str, int]  # by extraction, the number of scenes in which it read no model without the message
    scored: dict[str, list[str]]  # by detector of scores, the attacks after which its mean is higher than before
    in_clean: int  # number of these in which a detector also detects the mark in the clean model
    seeds: list[int]  # the distinct numbers of seeds per scene, in ascending order
    models: int
    verdict: Verdict
    attacks: list[Survival]  # attacks that can be judged, the gentlest first; if none can, all of them
    incomplete: list[Survival]  # attacks that were measured in fewer scenes than others, and are not judged
    fewer_seeds: dict[str, tuple[int, int]]  # by attack that misses seeds of its scenes: models measured, and of these
    before: Survival | None
    gspure: Survival | None
    other_extractions: list[Survival]  # survival of the other extractions after GSPure
    not_reached: list[Survival]  # attacks that did not change the carrier of the extraction
    contradicted: list[str]  # attacks that changed what the extraction shows, but not its declared carrier
    same_mark: int  # number of scenes whose other scene's model shows the mark, and so is no control
    repeated: int  # number of models that equal another seed of their scene in all metrics
    names: dict[str, str]  # the display name of every variant, with the damage that the search for its strength reached
    scene_psnr: list[Summary]  # after each attack, the gentlest first; empty if the drops are known
    pruned: Interval | None  # the share of the rows that GSPure removed
    against_photographs: bool
    off_path: OffPath | None
    random: dict[str, Interval]  # GSPure minus random pruning of as many rows, by quantity; empty if not run
    other_attacks: OtherAttacks | None
    failures: list[Failure]

    def where(self, survives: bool | None) -> list[Survival]:  # noqa: FBT001 (None: in some scenes only)
        """Return the judged attacks that the message survives in every scene, in some, or in none."""
        return [row for row in self.attacks if row.survives is survives and row not in self.only_retrieved]

    @property
    def judged_scenes(self) -> int:
        """The number of scenes in which the message was present before."""
        return max((row.present for row in self.attacks), default=0)

    @property
    def scene_after(self) -> dict[str, Interval | None]:
        """`scene_psnr` by variant; None if all renders are identical to those before it."""
        return {row.variant: row.scene for row in self.scene_psnr}

    @property
    def only_retrieved(self) -> list[Survival]:
        """The judged attacks after which the message is present in no scene, but still retrieved in some."""
        return [row for row in self.attacks if row.only_retrieved and not row.survived]

    @property
    def lost_in_fewer(self) -> list[Survival]:
        """The attacks that were measured in fewer scenes than others, and that the message did not survive in some."""
        return [row for row in self.incomplete if row.survived < row.present and row.reached is not False]

    @property
    def strongest(self) -> Survival | None:
        """The attack within `ALLOWED` that leaves the message in the smallest share of the scenes.

        Ties go to the smallest share of scenes in which the message survives, then to the largest drop of the message.
        An attack that was measured in fewer scenes than others counts if the message did not survive it there.
        """
        within = [
            ((-(row.survived + row.only_retrieved) / row.present, -row.survived / row.present), row.message_drop, row)
            for row in (*self.attacks, *self.lost_in_fewer)
            if self.verdict == "judged" and row.message_drop and is_allowed(row.scene_drop)
        ]
        return max(within, key=lambda ranked: (ranked[0], ranked[1].mean))[2] if within else None

    @property
    def as_strong(self) -> list[Survival]:
        """The other judged attacks within `ALLOWED` with the outcome of the `strongest`, and as large a drop."""
        if not (first := self.strongest) or not (most := first.message_drop):
            return []
        outcome = (first.present, first.survived, first.only_retrieved)
        return [
            row
            for row in self.attacks
            if row is not first and (row.present, row.survived, row.only_retrieved) == outcome
            if row.message_drop and is_allowed(row.scene_drop) and most.mean - row.message_drop.mean < EQUAL
        ]


def is_allowed(scene_drop: Interval | None) -> bool:
    """Return whether an attack that harms the scene so much counts for the verdict; searched damages are inexact."""
    return scene_drop is not None and scene_drop.mean <= ALLOWED + DAMAGE_TOLERANCE


def audits(outcomes: Sequence[Outcome], survivals: Sequence[Survival], contests: Sequence[Contest]) -> list[Audit]:
    """Return the audit of every condition, from the outcomes of all variants of all models, in their order."""
    return [
        _audit(
            alike,
            {(row.extraction, row.variant): row for row in survivals if condition_of(row) == condition},
            [c for c in contests if condition_of(c) == condition],
        )
        for condition, alike in by_condition(outcomes).items()
    ]


def _audit(outcomes: Sequence[Outcome], left: Mapping[tuple[str, str], Survival], contests: Sequence[Contest]) -> Audit:
    judged_by = _judged_by(outcomes, left)
    contests = [c for c in contests if c.extraction == judged_by]
    by_variant = {variant: row for (extraction, variant), row in left.items() if extraction == judged_by}
    attacks = sorted((row for row in by_variant.values() if row.variant != UNATTACKED), key=_damage)
    most = max((row.scenes for row in attacks), default=0)
    judged = [row for row in attacks if row.present and row.reached is not False and row.scenes == most]
    has_messages = any(o.messages for o in outcomes)
    known = [o for o in outcomes if not o.failure and (judged_by in o.messages or not has_messages)]
    folders = {o.folder for o in known}  # without the assets that are clean controls of others
    with_message = [o for o in outcomes if o.folder in folders]
    cells = {(o.scene, o.seed) for o in known if o.variant == UNATTACKED}
    scenes = {scene for scene, _ in cells}
    in_clean = {o.scene for o in known if o.variant == CLEAN and _is_detected(o, judged_by)}
    unchecked = doubtful_scenes(known, judged_by) - in_clean
    decided = {o.scene for o in known if o.variant == UNATTACKED and o.is_judged(judged_by)} - unchecked
    as_run = [c for c in contests if isnan(c.damage)]
    return Audit(
        condition=outcomes[0].condition,
        extraction=judged_by,
        scenes=len(scenes),
        unknown=len(scenes - decided),
        unchecked={
            name: _unchecked(outcomes, name) for name in dict.fromkeys(name for o in known for name in o.messages)
        },
        scored=_scored(known, left),
        in_clean=len(in_clean),
        seeds=sorted({sum(scene == other for other, _ in cells) for scene in scenes}),
        models=len({o.folder for o in outcomes}),
        verdict="judged" if judged else _why_not_judged(outcomes, by_variant, judged_by),
        attacks=judged or attacks,
        incomplete=[row for row in attacks if judged and row.scenes < most],
        fewer_seeds=_fewer_seeds(known),
        before=by_variant.get(UNATTACKED),
        gspure=by_variant.get(GSPURE),
        other_extractions=[row for (name, variant), row in left.items() if variant == GSPURE and name != judged_by],
        not_reached=[row for row in attacks if row.reached is False],
        contradicted=[*dict.fromkeys(o.variant for o in known if o.contradicts(judged_by))],
        same_mark=len({o.scene for o in known if o.variant == OTHER_SCENE and _is_detected(o, judged_by)}),
        repeated=_repeated([o for o in known if o.variant == UNATTACKED]),
        names=reached_names(with_message),
        scene_psnr=[] if any(row.scene_drop for row in attacks) else _scene_psnr(with_message),
        pruned=known_interval({(o.scene, o.seed): o.pruned_share for o in with_message if o.variant == GSPURE}),
        against_photographs=all(o.against_truth for o in outcomes),
        off_path=_off_path([o for o in outcomes if o.variant == GSPURE]),
        random={c.quantity: c.difference for c in as_run if c.attack == RANDOM},
        other_attacks=_other_attacks(contests),
        failures=_failures(outcomes),
    )


def _judged_by(outcomes: Sequence[Outcome], left: Mapping[tuple[str, str], Survival]) -> str:
    """Return the scheme's own extraction or, without one, the first detector that finds the mark before any attack."""
    names = ordered({name for o in outcomes for name in o.messages})
    finding = [name for name in names if (row := left.get((name, UNATTACKED))) and row.present]
    own = [name for name in names if is_picture(name) or name == BITS]
    return next(iter([*own, *finding, *names]), MESSAGE)


def _unchecked(outcomes: Sequence[Outcome], extraction: str) -> int:
    known = [o for o in outcomes if not o.failure and extraction in o.messages]
    controls = MESSAGE_FREE if is_picture(extraction) else {CLEAN}
    checked = {o.scene for o in known if o.variant in controls}
    return len({o.scene for o in known if o.variant == UNATTACKED} - checked)


def _scored(known: Sequence[Outcome], left: Mapping[tuple[str, str], Survival]) -> dict[str, list[str]]:
    scores = dict.fromkeys(name for o in known for name, read in o.detections.items() if not read.bits)
    raised = [key for key, row in left.items() if row.message_drop and row.message_drop.mean < 0]
    return {name: [variant for extraction, variant in raised if extraction == name] for name in scores}


def _fewer_seeds(known: Sequence[Outcome]) -> dict[str, tuple[int, int]]:
    cells = {v: {(o.scene, o.seed) for o in alike} for v, alike in grouped(known, lambda o: o.variant).items()}
    counts = {}
    for variant, measured in cells.items():
        scenes = {scene for scene, _ in measured}
        marked = {(scene, seed) for scene, seed in cells.get(UNATTACKED, ()) if scene in scenes}
        if variant not in CONTROLS and 0 < len(marked & measured) < len(marked):
            counts[variant] = len(marked & measured), len(marked)
    return counts


def _repeated(unattacked: Sequence[Outcome]) -> int:
    """Return how many models repeat another one of their scene: a scheme may ignore its seed."""
    measured = [o for o in unattacked if any(isfinite(mean.psnr) for mean in o.targets.values())]
    return sum(
        any(
            o.scene == other.scene and o.targets == other.targets and o.detections == other.detections for other in past
        )
        for past, o in ((measured[:i], o) for i, o in enumerate(measured))
    )


def _is_detected(o: Outcome, extraction: str) -> bool:
    return extraction in o.detections and bool(o.detections[extraction].present)


def _why_not_judged(outcomes: Sequence[Outcome], by_variant: Mapping[str, Survival], judged_by: str) -> Verdict:
    if all(o.failure for o in outcomes):
        return "failed"
    if not any(o.messages for o in outcomes):
        return "no key"
    if not by_variant:
        return "no survival"
    if UNATTACKED not in by_variant:
        return "no reference"
    flat = all(o.is_flat(MESSAGE) for o in outcomes if o.variant == UNATTACKED and not o.failure)
    readings = [o.is_judged(judged_by) for o in outcomes if o.variant == UNATTACKED and judged_by in o.detections]
    if not any(readings or [flat, *(row.above_floor for row in by_variant.values())]):
        return "no controls"
    return "not touched" if any(row.present for row in by_variant.values()) else "not present"


def _other_attacks(contests: Sequence[Contest]) -> OtherAttacks | None:
    scores = [c for c in contests if c.quantity == SCORE and isnan(c.damage)]
    if not scores:
        return None
    strongest: list[Contest] = []
    damages = sorted({c.damage for c in contests if not isnan(c.damage)})
    for damage in damages:
        ahead = [c for c in contests if c.damage == damage and c.difference.mean <= -EQUAL]
        consistent = [c for c in ahead if c.difference.excludes_zero]
        if consistent:
            strongest.append(min(consistent, key=lambda c: c.difference.mean))
    return OtherAttacks(
        len(scores),
        max(c.difference.scenes for c in scores),
        sorted((c for c in scores if c.difference.mean <= -EQUAL), key=lambda c: c.difference.mean),
        [c for c in scores if abs(c.difference.mean) < EQUAL],
        strongest,
        damages,
        max((c.difference.scenes for c in contests if not isnan(c.damage)), default=0),
        [c for c in scores if c.p_adjusted <= SIGNIFICANT],
        min(c.p_attainable for c in scores),
    )


def _off_path(gspure: Sequence[Outcome]) -> OffPath | None:
    """Return the drops by GSPure off and on the camera path, where all are known.

    The decision of GSPure uses only views on the path.
    """
    drops = {
        (o.scene, o.seed): [side.psnr_drop(target) for side in (o.off_path_outcome(), o) for target in (MESSAGE, SCENE)]
        for o in gspure
    }
    known = {cell: values for cell, values in drops.items() if all(map(isfinite, values))}
    columns = (by_scene({cell: values[i] for cell, values in known.items()}) for i in range(len(OffPath._fields)))
    return OffPath(*map(mean_interval, columns)) if known else None


def _scene_psnr(outcomes: Sequence[Outcome]) -> list[Summary]:
    attacks = [o for o in outcomes if o.variant != UNATTACKED and not o.is_control and SCENE in o.targets]
    rows = {row.variant: row for row in summarize(attacks)}
    return sorted(rows.values(), key=lambda row: -row.scene.mean if row.scene else -inf)


def _failures(outcomes: Sequence[Outcome]) -> list[Failure]:
    by_reason: dict[str, list[tuple[str, str]]] = {}
    for o in outcomes:
        for name, reason in o.failures.items():
            by_reason.setdefault(reason, []).append((name, o.folder))
    return [
        Failure(reason, list(dict.fromkeys(name for name, _ in failed)), len({folder for _, folder in failed}))
        for reason, failed in by_reason.items()
    ]


def _damage(row: Survival) -> float:
    return row.scene_drop.mean if row.scene_drop else inf
