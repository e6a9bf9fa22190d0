"""The owner's audit under one condition: whether the message survived, in one sentence, and what limits the answer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Final, Literal

from gspure.evaluation.matched import DAMAGE_TOLERANCE, MATCHED_DAMAGES
from gspure.evaluation.names import CLEAN, MESSAGE_FREE, UNATTACKED, display_name, extraction_name
from gspure.evaluation.outcomes import BITS, MESSAGE, Condition, Outcome, by_condition, extractions, is_picture
from gspure.evaluation.survival import Survival, doubtful_scenes
from gspure.progress import decimal, significant

ALLOWED: Final = MATCHED_DAMAGES[-1]  # largest damage to the scene of an attack that counts for the verdict, dB

Verdict = Literal["survived", "partly", "removed", "not present", "not affected", "unknown"]

SENTENCES: Final[Mapping[Verdict, str]] = {
    "survived": "The {message} survived every tested attack with at most {allowed} dB of damage to the scene. The "
    "strongest, {attack}: {drops}.",
    "partly": "The {message} is present or retrieved in {left} of {scenes} after {attack}: {drops}.",
    "removed": "The {message} did not survive {attack}: {drops}.",
    "not present": "No verdict: before any attack, the {message} does not exceed the controls, or is not retrieved. "
    "Look at the extraction before the attacks.",
    "not affected": "No verdict: no attack changed anything that the extraction of the {message} reads.",
    "unknown": "No verdict: {reason}.",
}

NO_KEY: Final = "only the owner's key can tell whether an attack removed a message; the tables show damage to the scene"


@dataclass(frozen=True)
class Audit:
    """The answer for one scheme, protocol and initialization.

    `extraction` is what is judged: the scheme's own or, without one, a detector. `strongest` is the attack with at most
    `ALLOWED` damage that leaves the message in the smallest share of the scenes; ties go to the largest drop.
    """

    condition: Condition
    extraction: str
    verdict: Verdict
    strongest: Survival | None
    reason: str  # of an unknown verdict
    remarks: list[str]

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        facts = {"message": extraction_name(self.extraction), "allowed": f"{ALLOWED:g}", "reason": self.reason}
        if row := self.strongest:
            left = row.survived + row.only_retrieved
            scenes = f"{row.present} scene{'s' * (row.present != 1)}"
            facts |= {"attack": row.name, "drops": _drops(row), "left": str(left), "scenes": scenes}
        return SENTENCES[self.verdict].format(**facts)


def audits(outcomes: Sequence[Outcome], survivals: Sequence[Survival]) -> list[Audit]:
    """Return the audit of every condition, from the outcomes of all variants of all models, in their order."""
    return [
        _audit(alike, [row for row in survivals if row.condition == condition])
        for condition, alike in by_condition(outcomes).items()
    ]


def _audit(outcomes: Sequence[Outcome], rows: Sequence[Survival]) -> Audit:
    extraction = _judged_by(outcomes, rows)
    known = {row.variant: row for row in rows if row.extraction == extraction}
    attacks = [row for variant, row in known.items() if variant != UNATTACKED]
    judged = [row for row in attacks if row.present and row.reached is not False]
    strongest, present = _strongest(judged), any(row.present for row in known.values())
    verdict: Verdict
    reason = ""
    if strongest:
        left = strongest.survived + strongest.only_retrieved
        verdict = "removed" if not left else "survived" if strongest.survived == strongest.present else "partly"
    elif reason := _why_unknown(outcomes, known):
        verdict = "unknown"
    elif not present:
        verdict = "not present"
    elif attacks and not judged:
        verdict = "not affected"
    else:
        verdict, reason = "unknown", f"no attack was tested with at most {ALLOWED:g} dB of damage to the scene"
    return Audit(outcomes[0].condition, extraction, verdict, strongest, reason, _remarks(outcomes, extraction))


def _judged_by(outcomes: Sequence[Outcome], rows: Sequence[Survival]) -> str:
    """Return the scheme's own extraction or, without one, the first detector that finds the mark before any attack."""
    names = extractions(outcomes)
    finding = {row.extraction for row in rows if row.variant == UNATTACKED and row.present}
    own = [name for name in names if is_picture(name) or name == BITS]
    return next(iter([*own, *(name for name in names if name in finding), *names]), MESSAGE)


def _strongest(judged: Sequence[Survival]) -> Survival | None:
    """Return the strongest attack within `ALLOWED`.

    One that was measured in fewer scenes than others counts only if the message did not survive it there.
    """
    most = max((row.scenes for row in judged), default=0)
    within = [
        row
        for row in judged
        if row.scene_drop
        and row.scene_drop.mean <= ALLOWED + DAMAGE_TOLERANCE  # searched damages are inexact
        and row.message_drop
        and (row.scenes == most or row.survived < row.present)
    ]

    def strength(row: Survival) -> tuple[float, float, float]:
        left = (row.survived + row.only_retrieved) / row.present
        return -left, -row.survived / row.present, row.message_drop.mean if row.message_drop else -inf

    return max(within, key=strength, default=None)


def _why_unknown(outcomes: Sequence[Outcome], known: Mapping[str, Survival]) -> str:
    """Return why nothing can be judged; empty if it can."""
    if all(o.failure for o in outcomes):
        return "every variant is without results"
    if not any(o.messages for o in outcomes):
        return NO_KEY
    if UNATTACKED not in known:
        return "the message of the unattacked model is unknown"
    extraction = known[UNATTACKED].extraction
    unattacked = [o for o in outcomes if o.variant == UNATTACKED and not o.failure]
    if is_picture(extraction):
        flat = all(o.is_flat(MESSAGE) for o in unattacked)
        return "" if flat or any(row.above_floor for row in known.values()) else "there is no negative control"
    judged = any(o.detections[extraction].present is not None for o in unattacked if extraction in o.detections)
    return "" if judged else "there are too few views or, for scores, no clean model to compare with"


def _remarks(outcomes: Sequence[Outcome], extraction: str) -> list[str]:
    """Return what limits the verdict, one sentence each."""
    known = [o for o in outcomes if not o.failure and extraction in o.messages]
    scenes = {o.scene for o in known if o.variant == UNATTACKED}
    controls = MESSAGE_FREE if is_picture(extraction) else {CLEAN}
    unchecked = len(scenes - {o.scene for o in known if o.variant in controls})
    in_clean = len(doubtful_scenes(known, extraction))
    unaffected = dict.fromkeys(o.variant for o in known if not o.is_control and o.reaches(extraction) is False)
    unaffected.pop(UNATTACKED, None)
    facts = [
        (len(scenes) == 1, "Tested on one scene: the result may not hold for others."),
        (unchecked, f"Read from no model without the message in {unchecked} of {len(scenes)} scenes."),
        (in_clean, f"The clean model shows the mark, too, or is missing, in {in_clean} of {len(scenes)} scenes."),
        (unaffected, f"Changed nothing that the extraction reads: {', '.join(map(display_name, unaffected))}."),
    ]
    return [sentence for holds, sentence in facts if holds]


def _drops(row: Survival) -> str:
    """Return the drops of message and scene after an attack."""
    drop, scene = row.message_drop, row.scene_drop
    shown = is_picture(row.extraction)
    number = (decimal(-drop.mean, 1) if shown else significant(-drop.mean)) if drop else "?"
    unit, what = ("dB", "message") if shown else ("points", "mark")
    return f"{'PSNR: ' * shown}{what} {number} {unit}, scene {decimal(-scene.mean, 1) if scene else '?'} dB"
