"""The owner's audit under one condition: the damage at which the message is lost, and the limits of the verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Final, Literal, NamedTuple

from gspure.evaluation.identity import Condition
from gspure.evaluation.matched import MATCHED_DAMAGES
from gspure.evaluation.outcomes import Outcome, by_condition, extractions
from gspure.evaluation.survival import Survival, doubtful_scenes
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.metrics.names import CLEAN, MESSAGE_FREE, UNATTACKED, extraction_name
from gspure.metrics.targets import ADAPTIVE, HIDDEN_BITS, MESSAGE, is_picture
from gspure.text import decimal

ALLOWED: Final = MATCHED_DAMAGES[-1]  # largest damage to the scene of an attack that counts for the verdict, dB

BROKEN: Final = 1.0  # damage to the scene, dB: if less removes a message, it is broken; if more up to `ALLOWED`, weak

Verdict = Literal["broken", "weak", "holds", "not present", "not affected", "unknown"]

NO_VERDICT: Final[Mapping[str, str]] = {
    "not present": "before any attack, the {message} does not exceed the controls, or is not retrieved. Look at the "
    "extraction before the attacks",
    "not affected": "no attack changed anything that the extraction of the {message} reads",
    "unknown": "{reason}",
}

_OWNERS: Final[Mapping[str, str]] = {ADAPTIVE: "an owner who adapts", "message_oracle": "an oracle"}

NO_KEY: Final = "only the owner's key can tell whether an attack removed a message; the tables show damage to the scene"


class Loss(NamedTuple):
    """The gentlest attack after which a message is above the controls in no scene."""

    damage: float = inf  # to the scene, dB; infinite if there is no such attack
    attack: str = ""
    traces: bool = False  # whether retrieval still tells the message from others

    def within(self, damage: float) -> bool:
        """Return whether the attack does at most this damage, within the tolerance of a search for it."""
        return self.damage <= damage + DAMAGE_TOLERANCE

    def __str__(self) -> str:
        return f"{decimal(self.damage, 1)} dB of damage ({self.attack})"


@dataclass(frozen=True)
class Audit:
    """The answer for one scheme, protocol and initialization."""

    condition: Condition
    extraction: str  # the judged one: the scheme's own or, without one, a detector
    verdict: Verdict
    lost: Mapping[str, Loss]  # by extraction, also of other owners
    strongest: Survival | None  # attack with at most `ALLOWED` damage: fewest scenes left, then the largest drop
    reason: str  # reason of an unknown verdict
    remarks: list[str]

    @property
    def damage(self) -> float:
        """The least damage to the scene, dB, at which the message is lost; infinite if it never is."""
        return self.lost.get(self.extraction, Loss()).damage

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        message = extraction_name(self.extraction)
        loss = self.lost.get(self.extraction, Loss())
        if self.verdict in NO_VERDICT:
            return f"No verdict: {NO_VERDICT[self.verdict].format(message=message, reason=self.reason)}."
        if loss.within(ALLOWED):
            remark = ", but for traces that retrieval finds" if loss.traces else ""
            clauses = [f"the {message} is lost at {loss}{remark}"]
        elif self.verdict == "weak":
            clauses = [f"attacks with at most {ALLOWED:g} dB of damage remove the {message} from some scenes"]
        else:
            clauses = [f"no tested attack with at most {ALLOWED:g} dB of damage removes the {message}"]
        clauses += [_of_owner(name, loss) for name, loss in self.lost.items() if name != self.extraction]
        return f"{self.verdict.upper()}: {'; '.join(clauses)}."


def _of_owner(extraction: str, loss: Loss) -> str:
    """Return in words whether the owner with another extraction loses the message."""
    owner = _OWNERS.get(extraction, f"an owner of the {extraction_name(extraction)}")
    return f"{owner} loses it at {loss}" if loss.attack else f"{owner} keeps it"


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
    affecting = [row for row in attacks if row.present and row.reached is not False]
    strongest = _strongest(affecting)
    pictures = [row.extraction for row in rows if is_picture(row.extraction)]
    lost = {name: _loss(rows, name) for name in dict.fromkeys([extraction, *pictures])}
    reason = ""
    if strongest:
        verdict = _verdict(strongest, lost[extraction])
    elif reason := _why_unknown(outcomes, known):
        verdict = "unknown"
    elif not any(row.present for row in known.values()):
        verdict = "not present"
    elif attacks and not affecting:
        verdict = "not affected"
    else:
        verdict = "unknown"
        reason = f"no attack was tested with at most {ALLOWED:g} dB of damage to the scene"
    return Audit(outcomes[0].condition, extraction, verdict, lost, strongest, reason, _remarks(outcomes, extraction))


def _verdict(strongest: Survival, loss: Loss) -> Verdict:
    """Return the verdict where an attack was tested with at most `ALLOWED` damage."""
    if loss.within(BROKEN):
        return "broken"
    if loss.within(ALLOWED) or strongest.survived < strongest.present:
        return "weak"
    return "holds"


def _loss(rows: Sequence[Survival], extraction: str) -> Loss:
    losses = []
    for row in rows:
        damage = row.scene_drop or row.damage
        if row.extraction == extraction and row.present and not row.survived and damage:
            losses.append(Loss(damage.mean, row.name, row.only_retrieved > 0))
    return min(losses, default=Loss())


def _judged_by(outcomes: Sequence[Outcome], rows: Sequence[Survival]) -> str:
    """Return the scheme's own extraction or, without one, the first detector that finds the mark before any attack."""
    detecting = {row.extraction for row in rows if row.variant == UNATTACKED and row.present}

    def rank(name: str) -> int:
        if is_picture(name) or name in HIDDEN_BITS:
            return 0
        return 1 if name in detecting else 2

    return min(extractions(outcomes), key=rank, default=MESSAGE)


def _strongest(affecting: Sequence[Survival]) -> Survival | None:
    """Return the strongest attack within `ALLOWED`.

    An attack that lacks some scenes counts only if it removes the message from a scene.
    """
    most = max((row.scenes for row in affecting), default=0)
    strength = {}
    for row in affecting:
        is_within = row.scene_drop and row.scene_drop.mean <= ALLOWED + DAMAGE_TOLERANCE  # searches are inexact
        if is_within and row.message_drop and (row.scenes == most or row.survived < row.present):
            left = (row.survived + row.only_retrieved) / row.present
            strength[row] = (-left, -row.survived / row.present, row.message_drop.mean)
    return max(strength, key=lambda row: strength[row], default=None)


def _why_unknown(outcomes: Sequence[Outcome], known: Mapping[str, Survival]) -> str:
    """Return why no verdict is possible; an empty text if it is."""
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
    """Return the limits of the verdict, one sentence each."""
    known = [o for o in outcomes if not o.failure and extraction in o.messages]
    scenes = {o.scene for o in known if o.variant == UNATTACKED}
    controls = MESSAGE_FREE if is_picture(extraction) else {CLEAN}
    unchecked = len(scenes - {o.scene for o in known if o.variant in controls})
    doubtful = len(doubtful_scenes(known, extraction))
    unaffected = {o.variant: o.title for o in known if not o.is_control and o.reaches(extraction) is False}
    unaffected.pop(UNATTACKED, None)
    facts = [
        (len(scenes) == 1, "Tested on one scene: the result may not hold for others."),
        (unchecked > 0, f"Read from no model without the message in {unchecked} of {len(scenes)} scenes."),
        (doubtful > 0, f"The clean model shows the mark, too, or is missing, in {doubtful} of {len(scenes)} scenes."),
        (bool(unaffected), f"Changed nothing that the extraction reads: {', '.join(unaffected.values())}."),
    ]
    return [sentence for holds, sentence in facts if holds]
