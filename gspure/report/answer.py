"""The answer in a terminal or as JSON: for every condition the attacks by damage, the controls, and the verdict."""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan, nan
from typing import Final, Literal, NamedTuple

from gspure.codec import plain
from gspure.evaluation.outcomes import Outcome, mean_of
from gspure.evaluation.survival import Survival
from gspure.files import Json
from gspure.metrics.image_metrics import MARGIN
from gspure.metrics.names import CONTROLS, GSPURE, UNATTACKED, WRONG_KEY, display_name, extraction_name
from gspure.metrics.statistics import LEVEL, Interval
from gspure.metrics.targets import ADAPTIVE, SCENE, is_picture
from gspure.report.audit import NO_VERDICT, Audit, Loss, audits
from gspure.scan.verdict import LIKELY, NOTHING, UNLIKE
from gspure.text import UNKNOWN, decimal, percent, significant

Left = Literal["survives", "in part", "traces", "lost", "unknown"]

_DETECTED: Final = {LIKELY: "yes", NOTHING: "no", UNLIKE: "unclear"}
_ALIGNMENTS: Final = "<>>><<"  # of the columns in a terminal


class AttackRow(NamedTuple):
    """One attack, mean over scenes; NaN is unknown."""

    variant: str
    attack: str  # its display name
    damage: float  # drop of the scene's PSNR, dB
    level: float  # the message's PSNR, dB, or mean reading of a mark; the scene's PSNR, if there is neither
    share: float  # share left of the message's level above the controls
    left: Left
    adaptive: Left | None  # `left` for an owner who adapts; None if the scheme has none


@dataclass(frozen=True)
class Answer:
    """The audit of one condition, its attacks by damage, and the levels of the message in its controls."""

    audit: Audit
    attacks: Sequence[AttackRow]
    controls: Mapping[str, float]
    has_message: bool
    before: Interval | None  # the message's level before any attack
    seeds: int

    @property
    def unit(self) -> str:
        """The unit of the message's level: none for readings of a detector."""
        is_psnr = not self.has_message or is_picture(self.audit.extraction)
        return " dB" if is_psnr else ""

    def level(self, value: float) -> str:
        """Return a level of the message as text, without its unit."""
        return decimal(value, 1) if self.unit else significant(value)

    @property
    def cheapest(self) -> AttackRow | None:
        """The successful attack that does the least damage."""
        name = self.audit.lost.get(self.audit.extraction, Loss()).attack
        return next((row for row in self.attacks if row.attack == name), None)

    def pictured(self, known: Container[str]) -> list[str]:
        """Return three of the `known` variants: the unattacked model, the cheapest successful attack and GSPure."""
        wanted = [UNATTACKED]
        if self.cheapest:
            wanted.append(self.cheapest.variant)
        wanted += [GSPURE, *(row.variant for row in self.attacks)]
        return [variant for variant in dict.fromkeys(wanted) if variant in known][:3]

    def key_numbers(self, scans: Sequence[Mapping[str, str]] = ()) -> Iterator[tuple[str, str]]:
        """Yield the key numbers of a condition with a message, each with its meaning.

        `scans` are the verdicts of a scan of each model, before and after GSPure.
        """
        yield self._damage()
        yield self._change()
        yield self._with_wrong_key()
        if scans:
            yield _scanned(scans)
        yield self._evidence()

    def _damage(self) -> tuple[str, str]:
        """Return the damage of the cheapest successful attack, and its meaning."""
        if self.cheapest:
            damage = f"{decimal(self.cheapest.damage, 1)} dB"
            return damage, f"damage of the cheapest successful attack, {self.cheapest.attack}"
        if self.audit.verdict in NO_VERDICT:
            return UNKNOWN, "no verdict on the attacks"
        return "none", "no tested attack removes the message from all scenes"

    def _change(self) -> tuple[str, str]:
        """Return the message's level before and after the cheapest successful attack, or else the strongest one."""
        message = extraction_name(self.audit.extraction)
        before = self.level(self.before.mean if self.before else nan)
        shown = self.cheapest
        if not shown and self.audit.strongest:
            strongest = self.audit.strongest.name
            shown = next((row for row in self.attacks if row.attack == strongest), None)
        if not shown:
            return f"{before}{self.unit}", f"{message} before any attack"
        return f"{before} → {self.level(shown.level)}{self.unit}", f"{message} before and after {shown.attack}"

    def _with_wrong_key(self) -> tuple[str, str]:
        """Return the message's level with a wrong key, beside the highest of the other controls."""
        wrong_key = display_name(WRONG_KEY)
        level = self.controls.get(wrong_key, nan)
        other_controls = [level for name, level in self.controls.items() if name != wrong_key]
        highest = max(other_controls, default=nan)
        if not isfinite(level):
            return UNKNOWN, "no wrong key was tried"
        remark = ": a part shows" if self.unit and level - highest >= MARGIN else ""
        return f"{self.level(level)}{self.unit}", f"with a wrong key{remark}; others: at most {self.level(highest)}"

    def _evidence(self) -> tuple[str, str]:
        """Return the numbers of scenes and seeds, and whether they suffice for an interval."""
        scenes = self.before.scenes if self.before else 0
        has_interval = self.before is not None and self.before.level >= LEVEL
        kind = "means with 95% intervals" if has_interval else "too few for an interval; add pairs"
        count_of_scenes = f"{scenes} scene" if scenes == 1 else f"{scenes} scenes"
        count_of_seeds = f"{self.seeds} seed" if self.seeds == 1 else f"{self.seeds} seeds"
        return f"{count_of_scenes}, {count_of_seeds}", f"evidence: {kind}"

    def lines(self) -> Iterator[str]:
        """Yield the lines of a terminal."""
        table = self._table()
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        yield self.audit.condition.title
        for row in table:
            cells = zip(row, _ALIGNMENTS, widths, strict=False)
            yield "  ".join(f"{cell:{alignment}{width}}" for cell, alignment, width in cells).rstrip()
        if self.controls:
            yield "controls: " + ", ".join(f"{kind} {decimal(level, 1)}" for kind, level in self.controls.items())
        yield self.audit.sentence

    def _table(self) -> list[list[str]]:
        """Return the cells of the attacks below their titles."""
        adapts = self.has_message and any(row.adaptive for row in self.attacks)
        name = extraction_name(self.audit.extraction) if self.has_message else SCENE
        titles = ["attack", "damage dB", f"{name}{self.unit}"]
        if self.has_message:
            titles += ["left", "verdict"]
        if adapts:
            titles.append("owner who adapts")
        table = [titles]
        for row in self.attacks:
            cells = [row.attack, decimal(row.damage, 1), self.level(row.level)]
            if self.has_message:
                cells += [percent(row.share, 0), row.left]
            if adapts:
                cells.append(row.adaptive or "unknown")
            table.append(cells)
        return table

    def facts(self) -> Json:
        """Return all of it for JSON; unknown and infinite numbers are null."""
        facts = {name: getattr(self.audit, name) for name in ("condition", "verdict", "sentence", "lost")}
        facts |= {"attacks": self.attacks, "controls": self.controls}
        return {name: plain(value) for name, value in facts.items()}


def answers(outcomes: Sequence[Outcome], survivals: Sequence[Survival]) -> list[Answer]:
    """Return the answer for every condition, from the outcomes of all variants of all models, in their order."""
    return [_answer(audit, outcomes, survivals) for audit in audits(outcomes, survivals)]


def _answer(audit: Audit, outcomes: Sequence[Outcome], survivals: Sequence[Survival]) -> Answer:
    alike = [o for o in outcomes if o.condition == audit.condition]
    rows = [row for row in survivals if row.condition == audit.condition]
    known = {row.variant: row for row in rows if row.extraction == audit.extraction}
    adapted = {row.variant: row for row in rows if row.extraction == ADAPTIVE}
    attacks = [*_attack_rows(alike, known, audit.extraction, adapted)]
    attacks.sort(key=lambda row: (isnan(row.damage), row.damage, row.attack))  # failed ones last
    levels = {name: _mean(alike, name, audit.extraction) for name in CONTROLS}
    controls = {display_name(name): level.mean for name, level in levels.items() if level}
    return Answer(
        audit=audit,
        attacks=attacks,
        controls=controls if known else {},
        has_message=bool(known),
        before=_mean(alike, UNATTACKED, audit.extraction),
        seeds=len({o.seed for o in alike}),
    )


def _attack_rows(
    alike: Sequence[Outcome], known: Mapping[str, Survival], extraction: str, adapted: Mapping[str, Survival]
) -> Iterator[AttackRow]:
    """Yield the attacks of one condition; `known` and `adapted` hold the survival by variant, without and with it."""
    for variant in dict.fromkeys(o.variant for o in alike if not o.is_control and o.variant != UNATTACKED):
        row = known.get(variant)
        outcomes = [o for o in alike if o.variant == variant]
        damage = mean_of(outcomes, lambda o: o.damage)
        level = _mean(alike, variant, extraction if known else SCENE)
        yield AttackRow(
            variant=variant,
            attack=row.name if row else outcomes[0].title,
            damage=damage.mean if damage else nan,
            level=level.mean if level else nan,
            share=row.share_left.mean if row and row.share_left else nan,
            left=_left(row),
            adaptive=_left(adapted.get(variant)) if adapted else None,
        )


def _mean(alike: Sequence[Outcome], variant: str, target: str) -> Interval | None:
    return mean_of([o for o in alike if o.variant == variant], lambda o: o.level(target))


def _left(row: Survival | None) -> Left:
    if not row or not row.present:
        return "unknown"
    if row.survived == row.present:
        return "survives"
    if row.survived:
        return "in part"
    return "traces" if row.only_retrieved else "lost"


def _scanned(scans: Sequence[Mapping[str, str]]) -> tuple[str, str]:
    """Return whether scans detect a message before and after GSPure; of several models, in how many."""
    texts = []
    for when in ("before", "after"):
        answers = [_DETECTED[scan[when]] for scan in scans]
        texts.append(answers[0] if len(answers) == 1 else f"{answers.count('yes')} of {len(answers)}")
    return " → ".join(texts), "detectable without a key, before and after GSPure"
