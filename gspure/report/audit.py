"""The owner's audit under one condition: the robust radius, the verdict that follows from it, and its limits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isnan
from typing import Final, Literal

from gspure.evaluation.identity import Condition
from gspure.evaluation.radius import Kind, ModelRadius, Radius, model_radii, radii
from gspure.evaluation.results import ADAPTS, PUBLISHED, READABLE, TRACES, OwnerName, Result
from gspure.grouping import grouped
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.metrics.names import UNATTACKED, WRONG_KEY, extraction_name, is_message_free, variant_title
from gspure.metrics.targets import HIDDEN_BITS, MESSAGE, is_picture
from gspure.text import decimal

BROKEN: Final = 1.0  # a message whose radius is at most this damage to the scene, dB, is broken
WEAK: Final = 2.0  # with at most this one, it is weak

Verdict = Literal["broken", "weak", "holds", "not present", "unknown"]

NO_KEY: Final = (
    "only the owner's key can tell whether an attack removed a message; the tables show what each costs the scene"
)


@dataclass(frozen=True)
class ConditionAudit:
    """The answer for one scheme, protocol and initialization."""

    condition: Condition
    extraction: str  # the judged one as published: the scheme's own or, without one, a detector
    verdict: Verdict
    radii: Sequence[Radius]
    models: Sequence[ModelRadius]  # their radii, by scene and seed
    titles: Mapping[str, str]  # of variants
    reason: str  # why there is no verdict
    remarks: Sequence[str]

    def radius(self, kind: Kind = "message", owner: OwnerName = "") -> Radius | None:
        """Return the radius of an owner, by default of the one who adapts, if there is one."""
        of_kind = {radius.owner: radius for radius in self.radii if radius.kind == kind}
        return of_kind.get(owner) if owner else of_kind.get(ADAPTS, of_kind.get(PUBLISHED))

    @property
    def has_radius(self) -> bool:
        """Whether a damage is known at which the message is gone, or up to which it is not."""
        radius = self.radius()
        return radius is not None and not isnan(radius.radius)

    @property
    def damage(self) -> float:
        """The least damage to the scene, dB, at which the message is gone; infinite if no attack ends it."""
        radius = self.radius()
        return inf if radius is None or radius.exceeds or isnan(radius.radius) else radius.radius

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        message = extraction_name(self.extraction)
        radius = self.radius()
        if radius is None or self.verdict in ("not present", "unknown"):
            return f"No verdict: {self.reason}."
        clauses = [f"{self.verdict.upper()}: the {message} is {self.ended(radius, 'gone')}"]
        readable = self.radius("readable")
        if readable and (readable.killer, readable.radius) != (radius.killer, radius.radius):
            clauses.append(f"it is {self.ended(readable, 'no longer readable')}")
        published = self.radius(owner=PUBLISHED)
        if radius.owner == ADAPTS and published and published.killer != radius.killer:
            clauses.append(f"as published, it is {self.ended(published, 'gone')}")
        return "; ".join(clauses) + "."

    def ended(self, radius: Radius, end: str) -> str:
        """Return in words where a radius ends: the damage, and the attack that does it."""
        if radius.exceeds:
            if isnan(radius.radius):
                return f"not {end} after any attack"
            return f"not {end} after any attack of at most {decimal(radius.radius, 1)} dB of damage"
        killer = self.titles.get(radius.killer, radius.killer)
        if isnan(radius.radius):
            return f"{end} at a fidelity of {decimal(radius.fidelity, 1)} dB ({killer})"
        return f"{end} at {radius} of damage ({killer})"


def audits(rows: Sequence[Result]) -> list[ConditionAudit]:
    """Return the audit of every condition, in the order of the results."""
    return [_audit(condition, alike) for condition, alike in grouped(rows, lambda row: row.condition).items()]


def _audit(condition: Condition, rows: Sequence[Result]) -> ConditionAudit:
    extraction = _judged_by(rows)
    judged = [row for row in rows if is_judged(row, extraction)]
    of_models = model_radii(judged)
    known = radii(of_models, {row.model: condition for row in judged})
    verdict, reason = _verdict(rows, judged, known)
    titles = {row.variant: variant_title(row.entry or row.variant, row.wanted) for row in rows}
    return ConditionAudit(condition, extraction, verdict, known, of_models, titles, reason, _remarks(judged))


def is_judged(row: Result, extraction: str) -> bool:
    """Return whether the verdict on an extraction follows from a row, as from every picture of the same message."""
    return row.extraction == extraction or (is_picture(extraction) and is_picture(row.extraction))


def _judged_by(rows: Sequence[Result]) -> str:
    """Return the scheme's own extraction or, without one, the first detector that finds the mark before any attack."""
    detecting = {row.extraction for row in rows if row.variant == UNATTACKED and row.is_proven}
    names = dict.fromkeys(row.extraction for row in rows if row.extraction)

    def rank(name: str) -> int:
        if name in (MESSAGE, *HIDDEN_BITS):
            return 0
        return 1 if name in detecting else 2

    return min(names, key=rank, default=MESSAGE)


def _verdict(rows: Sequence[Result], judged: Sequence[Result], known: Sequence[Radius]) -> tuple[Verdict, str]:
    """Return the verdict, and why there is none."""
    of_message = [radius for radius in known if radius.kind == "message"]
    if of_message:
        return _by_radius(of_message[-1])  # of the owner who adapts, if there is one
    before = [row for row in judged if row.variant == UNATTACKED]
    if all(row.failure and not row.word for row in rows):
        reason = "every variant is without results"
    elif not judged:
        reason = NO_KEY
    elif not any(row.is_decided for row in before):
        reason = "nothing tells whether the unattacked model shows the message: too few views or candidates"
    elif not any(row.is_proven for row in before):
        return "not present", _not_present(judged)
    else:
        reason = "no attack was evaluated"
    return "unknown", reason


def _not_present(judged: Sequence[Result]) -> str:
    """Return why a message is not proven before any attack."""
    if any(row.is_proven for row in judged if is_message_free(row.variant)):
        return "with this key, a model that never held the message shows it, too; a test needs eight such models"
    return "before any attack, the message is not proven: look at the extraction"


def _by_radius(radius: Radius) -> tuple[Verdict, str]:
    """Return the verdict that follows from a radius, or why none does."""
    if isnan(radius.radius):
        if not radius.killer:
            return "unknown", "damage needs photographs; the message is not gone after any attack"
        fidelity = decimal(radius.fidelity, 1)
        return "unknown", f"damage needs photographs; the message is gone at a fidelity of {fidelity} dB"
    if radius.exceeds and radius.radius < BROKEN:
        return "unknown", f"no attack was tested with more than {decimal(radius.radius, 1)} dB of damage"
    if radius.exceeds or radius.radius > WEAK + DAMAGE_TOLERANCE:
        return "holds", ""
    if radius.radius > BROKEN + DAMAGE_TOLERANCE:
        return "weak", ""
    return "broken", ""


def _remarks(judged: Sequence[Result]) -> list[str]:
    """Return the limits of the verdict, one sentence each."""
    scenes = {row.scene for row in judged if row.variant == UNATTACKED}
    wrong_key = [row for row in judged if row.variant == WRONG_KEY and row.word in (READABLE, TRACES)]
    attacked = [row for row in judged if row.is_attack]
    reached = {row.title for row in attacked if row.reached is not False}
    unaffected = dict.fromkeys(row.title for row in attacked if row.title not in reached)
    nulls = {(row.candidates, row.clean_models, row.twins, row.level) for row in attacked if row.candidates}
    remarks = []
    if nulls:
        candidates, clean_models, twins, level = min(nulls)
        tests = [f"its rank among {candidates} candidates"]
        tests += [f"a t-test against {twins} redrawn twins"] if twins else []
        tests += [f"a t-test against {clean_models} clean models"] if clean_models else []
        remarks.append(f"Proven means p ≤ {decimal(level, 3)} by {', and by '.join(tests)}.")
    if any(not row.candidates and not isnan(row.trace) for row in attacked):
        remarks.append("There are no candidates of the message's kind: what is said of it is no proof.")
    if wrong_key:
        remarks.append("A wrong key shows the message, too: the key keeps nothing secret.")
    if len(scenes) == 1:
        remarks.append("Tested on one scene: the result may not hold for others.")
    if unaffected:
        remarks.append(f"Changed nothing that the extraction reads: {', '.join(unaffected)}.")
    return remarks
