"""The answer in a terminal or as JSON: for every condition the attacks by damage, the controls, and the verdict."""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan, nan
from typing import Any, Final, Literal, NamedTuple

from gspure.evaluation.outcomes import Outcome, mean_of
from gspure.evaluation.survival import Survival
from gspure.metrics.image_metrics import MARGIN
from gspure.metrics.names import CONTROLS, GSPURE, UNATTACKED, WRONG_KEY, display_name, extraction_name
from gspure.metrics.statistics import LEVEL, Interval
from gspure.metrics.targets import ADAPTIVE, SCENE, is_picture
from gspure.report.audit import NO_VERDICT, Audit, Loss, audits
from gspure.scan.verdict import LIKELY, NOTHING, UNLIKE
from gspure.text import UNKNOWN, decimal, percent, significant

Left = Literal["survives", "in part", "traces", "lost", "unknown"]

_DETECTED: Final = {LIKELY: "yes", NOTHING: "no", UNLIKE: "unclear"}


class Attacked(NamedTuple):
    """One attack, mean over scenes; NaN is unknown."""

    variant: str
    attack: str  # its display name
    damage: float  # drop of the scene's PSNR, dB
    level: float  # the message's PSNR, dB, or mean reading of a mark; the scene's PSNR, if there is neither
    share: float  # left of the message's level above the controls
    left: Left
    adaptive: Left | None  # the same of an owner who adapts; None if the scheme has none


@dataclass(frozen=True)
class Answer:
    """The audit of one condition, its attacks by damage, and the levels of the message in its controls."""

    audit: Audit
    attacks: Sequence[Attacked]
    controls: Mapping[str, float]
    has_message: bool
    before: Interval | None  # the message's level before any attack
    seeds: int

    @property
    def unit(self) -> str:
        """The unit of the message's level: none for readings of a detector."""
        return " dB" * (not self.has_message or is_picture(self.audit.extraction))

    def level(self, value: float) -> str:
        """Return a level of the message as text, without its unit."""
        return decimal(value, 1) if self.unit else significant(value)

    @property
    def cheapest(self) -> Attacked | None:
        """The successful attack that does the least damage."""
        name = self.audit.lost.get(self.audit.extraction, Loss()).attack
        return next((row for row in self.attacks if row.attack == name), None)

    def pictured(self, known: Container[str]) -> list[str]:
        """Return three of the `known` variants: the unattacked model, the cheapest successful attack and GSPure."""
        first = [self.cheapest.variant] if self.cheapest else []
        wanted = dict.fromkeys([UNATTACKED, *first, GSPURE, *(row.variant for row in self.attacks)])
        return [variant for variant in wanted if variant in known][:3]

    def tiles(self, scans: Sequence[Mapping[str, str]] = ()) -> Iterator[tuple[str, str]]:
        """Yield the key numbers of a condition with a message, each with its meaning.

        `scans` are the verdicts of a scan of each model, before and after GSPure.
        """
        message, strongest = extraction_name(self.audit.extraction), self.audit.strongest
        after = self.cheapest or next((row for row in self.attacks if strongest and row.attack == strongest.name), None)
        before = self.level(self.before.mean if self.before else nan)
        if first := self.cheapest:
            yield f"{decimal(first.damage, 1)} dB", f"damage of the cheapest successful attack, {first.attack}"
        elif self.audit.verdict in NO_VERDICT:
            yield UNKNOWN, "no verdict on the attacks"
        else:
            yield "none", "no tested attack removes the message from all scenes"
        if after:
            yield f"{before} → {self.level(after.level)}{self.unit}", f"{message} before and after {after.attack}"
        else:
            yield f"{before}{self.unit}", f"{message} before any attack"
        others = dict(self.controls)
        wrong = others.pop(display_name(WRONG_KEY), nan)
        floor = max(others.values(), default=nan)
        shows = ": a part shows" if self.unit and wrong - floor >= MARGIN else ""
        meaning = f"with a wrong key{shows}; others: at most {self.level(floor)}"
        yield (f"{self.level(wrong)}{self.unit}", meaning) if isfinite(wrong) else (UNKNOWN, "no wrong key was tried")
        if scans:
            words = [[_DETECTED[scan[when]] for scan in scans] for when in ("before", "after")]
            both = [each[0] if len(each) == 1 else f"{each.count('yes')} of {len(each)}" for each in words]
            yield " → ".join(both), "detectable without a key, before and after GSPure"
        scenes, level = (self.before.scenes, self.before.level) if self.before else (0, 0.0)
        counts = f"{scenes} scene{'s' * (scenes != 1)}, {self.seeds} seed{'s' * (self.seeds != 1)}"
        kind = "means with 95% intervals" if level >= LEVEL else "too few for an interval; add pairs"
        yield counts, f"evidence: {kind}"

    def lines(self) -> Iterator[str]:
        """Yield the lines of a terminal."""
        name = extraction_name(self.audit.extraction) if self.has_message else SCENE
        adapts = any(row.adaptive for row in self.attacks)
        columns = 5 + adapts if self.has_message else 3
        rows = [("attack", "damage dB", f"{name}{self.unit}", "left", "verdict", "owner who adapts")[:columns]]
        for row in self.attacks:
            damage, level, share = decimal(row.damage, 1), self.level(row.level), percent(row.share, 0)
            rows.append((row.attack, damage, level, share, row.left, row.adaptive or "unknown")[:columns])
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        yield self.audit.condition.title
        for first, *numbers in rows:
            cells = [f"{cell:>{width}}" for cell, width in zip(numbers[:3], widths[1:4], strict=False)]
            cells += [f"{cell:<{width}}" for cell, width in zip(numbers[3:], widths[4:], strict=True)]
            yield "  ".join([f"{first:<{widths[0]}}", *cells]).rstrip()
        if self.controls:
            yield "controls: " + ", ".join(f"{kind} {decimal(level, 1)}" for kind, level in self.controls.items())
        yield self.audit.sentence

    def facts(self) -> dict[str, Any]:
        """Return all of it for JSON; what is unknown or infinite is null."""
        facts = {name: getattr(self.audit, name) for name in ("condition", "verdict", "sentence", "lost")}
        facts |= {"attacks": self.attacks, "controls": self.controls}
        return {name: _plain(value) for name, value in facts.items()}


def answers(outcomes: Sequence[Outcome], survivals: Sequence[Survival]) -> list[Answer]:
    """Return the answer for every condition, from the outcomes of all variants of all models, in their order."""
    found = []
    for audit in audits(outcomes, survivals):
        alike = [o for o in outcomes if o.condition == audit.condition]
        known = [row for row in survivals if row.condition == audit.condition and row.extraction == audit.extraction]
        adapted = {r.variant: r for r in survivals if r.condition == audit.condition and r.extraction == ADAPTIVE}
        attacks = [*_attacked(alike, known, audit.extraction, adapted)]
        attacks.sort(key=lambda row: (isnan(row.damage), row.damage, row.attack))  # failed ones last
        levels = {name: _mean(alike, name, audit.extraction) for name in CONTROLS}
        controls = {display_name(name): level.mean for name, level in levels.items() if level}
        before, seeds = _mean(alike, UNATTACKED, audit.extraction), len({o.seed for o in alike})
        found.append(Answer(audit, attacks, controls if known else {}, bool(known), before, seeds))
    return found


def _attacked(
    alike: Sequence[Outcome], rows: Sequence[Survival], extraction: str, adapted: Mapping[str, Survival]
) -> Iterator[Attacked]:
    of_variant = {row.variant: row for row in rows}
    titles = {o.variant: o.title for o in alike}
    for variant in dict.fromkeys(o.variant for o in alike if not o.is_control and o.variant != UNATTACKED):
        row, level = of_variant.get(variant), _mean(alike, variant, extraction if rows else SCENE)
        damage = mean_of([o for o in alike if o.variant == variant], lambda o: o.damage)
        share = row.share_left.mean if row and row.share_left else nan
        name = row.name if row else titles[variant]
        numbers = damage.mean if damage else nan, level.mean if level else nan, share
        yield Attacked(variant, name, *numbers, _left(row), _left(adapted.get(variant)) if adapted else None)


def _mean(alike: Sequence[Outcome], variant: str, target: str) -> Interval | None:
    return mean_of([o for o in alike if o.variant == variant], lambda o: o.level(target))


def _left(row: Survival | None) -> Left:
    if not row or not row.present:
        return "unknown"
    if row.survived == row.present:
        return "survives"
    return "in part" if row.survived else "traces" if row.only_retrieved else "lost"


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return _plain(value._asdict())
    return [_plain(each) for each in value] if isinstance(value, list) else value
