"""The results of one model, and the limits of all numbers: the facts for ``templates/findings.j2``."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Final, NamedTuple

from gspure.evaluation.names import GSPURE, UNATTACKED
from gspure.evaluation.outcomes import MESSAGE, SCENE, Condition, Outcome, by_condition, ordered

PLANTED: Final = "planted"


class Change(NamedTuple):
    """The PSNR of a target before and after an attack, dB."""

    target: str
    before: float
    after: float


@dataclass(frozen=True)
class Findings:
    """The results of one model."""

    attacks: int
    views: dict[str, int]  # of the scene and, if it was extracted, of the message; empty if nothing was measured
    against_photographs: bool
    gspure: Outcome | None
    changes: list[Change]  # by GSPure: of the scene and of every extraction of the message


@dataclass(frozen=True)
class Limits:
    """Limits of the numbers on a page."""

    planted: bool
    one_scene: list[Condition]  # conditions with a message in a single scene
    without_key: list[tuple[str, str]]  # models, as scheme and folder, whose message was not extracted
    against_renders: list[tuple[str, str]]
    has_pictures: bool  # of messages
    has_detectors: bool
    views: list[int]  # the different numbers of views per model and target, in ascending order


def findings(outcomes: Sequence[Outcome]) -> Findings:
    """Return the results of one model, from all of its variants."""
    attacks = [o for o in outcomes if o.variant != UNATTACKED and not o.is_control and not o.failure]
    gspure = next((o for o in attacks if o.variant == GSPURE), None)
    views = {target: [o.views[target] for o in outcomes if target in o.views] for target in (SCENE, MESSAGE)}
    return Findings(
        attacks=len(attacks),
        views={target: max(counts) for target, counts in views.items() if counts},
        against_photographs=all(o.against_truth for o in outcomes),
        gspure=gspure,
        changes=_changes(gspure) if gspure else [],
    )


def limits(outcomes: Sequence[Outcome]) -> Limits:
    """Return the limits of the numbers of all models."""
    models = {(o.scheme, o.folder) for o in outcomes}
    extracted = [o for o in outcomes if o.messages]
    scenes = {
        condition: {o.scene for o in alike if not o.is_control} for condition, alike in by_condition(extracted).items()
    }
    return Limits(
        planted=PLANTED in {scheme for scheme, _ in models},
        one_scene=[condition for condition, known in sorted(scenes.items()) if len(known) == 1],
        without_key=sorted(models - {(o.scheme, o.folder) for o in extracted}),
        against_renders=sorted({(o.scheme, o.folder) for o in outcomes if not o.against_truth}),
        has_pictures=any(o.targets.keys() - {SCENE} for o in outcomes),
        has_detectors=any(o.detections for o in outcomes),
        views=sorted({count for o in outcomes for count in o.views.values()}),
    )


def _changes(gspure: Outcome) -> list[Change]:
    drops = {target: gspure.psnr_drop(target) for target in ordered(gspure.targets)}
    return [
        Change(target, gspure.reference[target].psnr, gspure.targets[target].psnr)
        for target, drop in drops.items()
        if isfinite(drop)
    ]
