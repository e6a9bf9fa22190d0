"""The answer in a terminal or as JSON: for every condition the radius, and the attacks by damage."""

from collections import Counter
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan, nan
from typing import Final, NamedTuple

import numpy as np

from gspure.codec import plain
from gspure.evaluation.outcomes import title_with_damage
from gspure.evaluation.radius import Radius
from gspure.evaluation.results import (
    ADAPTS,
    IN_ORDER,
    KEY_ONLY,
    PROVEN,
    PUBLISHED,
    READABLE,
    TRACES,
    OwnerName,
    Result,
    known_cells,
)
from gspure.files import Json
from gspure.grouping import grouped
from gspure.metrics import legibility
from gspure.metrics.names import CONTROLS, GSPURE, UNATTACKED, WRONG_KEY, display_name, is_control
from gspure.metrics.statistics import scene_means
from gspure.metrics.targets import MESSAGE, SCENE, is_picture
from gspure.report.audit import ConditionAudit, audits
from gspure.scan.verdict import LIKELY, NOTHING, UNLIKE
from gspure.text import UNKNOWN, decimal, p_value, percent, significant

_DETECTED: Final = {LIKELY: "found", NOTHING: "not found", UNLIKE: "unclear"}

_OF_PICTURES: Final[Mapping[str, str]] = {
    READABLE: f"≥ {percent(legibility.READABLE, 0)} legible",
    TRACES: f"≥ {percent(legibility.TRACES, 0)} legible",
    PROVEN: "less, but not by chance",
    KEY_ONLY: "gone (models without the message show as much)",
}
_OF_MARKS: Final[Mapping[str, str]] = {READABLE: "all of it", PROVEN: "a part, but not by chance"}


class AttackRow(NamedTuple):
    """One attack, mean over scenes; NaN is unknown. Its numbers of the message are those of the owner as published."""

    variant: str
    attack: str  # its display name
    damage: float  # drop of the scene's PSNR, dB
    fidelity: float  # PSNR of the scene against the unattacked model, dB; without photographs
    level: float  # the message's PSNR, dB, or mean reading of a mark; the scene's PSNR, if there is neither
    legibility: float  # R
    p: float  # the largest of a scene
    published: str  # whether the message is readable, shows traces, is proven or gone; of several scenes, in how many
    adaptive: str  # the same for an owner who adapts; empty if the scheme has none
    failure: str = ""  # why a model has no results

    @property
    def word(self) -> str:
        """What is left for the owner who adapts, if there is one."""
        return self.adaptive or self.published


@dataclass(frozen=True)
class Answer:
    """The audit of one condition, and its attacks by damage, the controls last."""

    audit: ConditionAudit
    attacks: Sequence[AttackRow]
    controls: Sequence[AttackRow]
    has_message: bool
    has_bits: bool
    scenes: int
    seeds: int

    @property
    def quantity(self) -> str:
        """What the level is, with its unit."""
        if not self.has_message:
            return f"{SCENE} dB"
        if is_picture(self.audit.extraction):
            return f"{MESSAGE} dB"
        return "correct bits %" if self.has_bits else "score"

    @property
    def has_legibility(self) -> bool:
        """Whether the message is a picture whose legibility was measured."""
        return any(isfinite(row.legibility) for row in self.attacks)

    @property
    def has_damage(self) -> bool:
        """Whether there are photographs; otherwise the axis is fidelity."""
        return any(isfinite(row.damage) for row in self.attacks)

    def level(self, value: float) -> str:
        """Return a level of the message as text, without its unit."""
        return decimal(value, 1) if self.quantity.endswith("dB") else significant(value)

    def axis(self, row: AttackRow) -> float:
        """Return what an attack costs: damage or, without photographs, fidelity, dB."""
        return row.damage if self.has_damage else row.fidelity

    @property
    def cheapest(self) -> AttackRow | None:
        """The attack that ends the message with the least damage."""
        radius = self.audit.radius()
        killer = radius.killer if radius else ""
        return next((row for row in self.attacks if row.variant == killer), None)

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
        owners: dict[OwnerName, str] = {
            ADAPTS: "if the owner adapts to the attack",
            PUBLISHED: "extracted as published",
        }
        names = {ADAPTS: "robust radius: the least damage that ends the message", PUBLISHED: "robust radius"}
        for owner, of_owner in owners.items():
            radius = self.audit.radius(owner=owner)
            if radius:
                name = "ends the message" if isnan(radius.radius) else names[owner]
                yield self._radius(radius), f"{name}, {of_owner}"
        readable = self.audit.radius("readable")
        if readable:
            yield (
                self._radius(readable),
                "makes it unreadable"
                if isnan(readable.radius)
                else "readable radius: the least that makes it unreadable",
            )
        yield self._with_wrong_key()
        if scans:
            yield _scanned(scans)
        yield self._evidence()

    @property
    def legend(self) -> str:
        """What the words in the table mean."""
        meanings = _OF_PICTURES if is_picture(self.audit.extraction) else _OF_MARKS
        words = " ".join(f"{row.published} {row.adaptive}" for row in self.attacks).split()
        return "; ".join(f"{word}: {meaning}" for word, meaning in meanings.items() if word in words)

    def _radius(self, radius: Radius) -> str:
        """Return a radius over the scenes as text, with its range."""
        if isnan(radius.radius):
            return "no attack" if radius.exceeds else f"fidelity {decimal(radius.fidelity, 1)} dB"
        if radius.scenes == 1:
            return str(radius)
        low = decimal(radius.low, 1)
        high = decimal(radius.high, 1) if isfinite(radius.high) else "more"
        return f"{radius} ({low} to {high})" if low != high else str(radius)

    def _with_wrong_key(self) -> tuple[str, str]:
        """Return whether a wrong key shows the message."""
        row = next((row for row in self.controls if row.variant == WRONG_KEY), None)
        return (row.published, "with a wrong key") if row else (UNKNOWN, "no wrong key was tried")

    def _evidence(self) -> tuple[str, str]:
        """Return the numbers of scenes and seeds."""
        count_of_scenes = f"{self.scenes} scene" if self.scenes == 1 else f"{self.scenes} scenes"
        count_of_seeds = f"{self.seeds} seed" if self.seeds == 1 else f"{self.seeds} seeds"
        return f"{count_of_scenes}, {count_of_seeds}", "evidence"

    def lines(self) -> Iterator[str]:
        """Yield the lines of a terminal."""
        table = self._table()
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        yield self.audit.condition.title
        for row in table:
            cells = [f"{cell:{'>' if number else '<'}{widths[number]}}" for number, cell in enumerate(row)]
            yield "  ".join(cells).rstrip()
        if self.legend:
            yield f"{self.legend}; p: probability by chance"
        controls = [f"{row.attack} {row.published}" for row in self.controls if row.published]
        if controls:
            yield f"controls: {', '.join(controls)}"
        yield self.audit.sentence

    def _table(self) -> list[list[str]]:
        """Return the cells of the attacks below their titles."""
        adapts = any(row.adaptive for row in self.attacks)
        titles = ["attack", "damage dB" if self.has_damage else "fidelity dB", self.quantity]
        if self.has_legibility:
            titles.append("legible")
        if self.has_message:
            titles += ["p", "as published"]
        if adapts:
            titles.append("owner who adapts")
        table = [titles]
        for row in self.attacks:
            cells = [row.attack, decimal(self.axis(row)), self.level(row.level)]
            if self.has_legibility:
                cells.append(percent(row.legibility, 0))
            if self.has_message:
                cells += [p_value(row.p), row.published or UNKNOWN]
            if adapts:
                cells.append(row.adaptive or UNKNOWN)
            table.append(cells)
        return table

    def facts(self) -> Json:
        """Return all of it for JSON; unknown and infinite numbers are null."""
        facts = {name: getattr(self.audit, name) for name in ("condition", "verdict", "sentence", "radii", "remarks")}
        facts |= {"attacks": self.attacks, "controls": self.controls}
        return {name: plain(value) for name, value in facts.items()}


def answers(rows: Sequence[Result]) -> list[Answer]:
    """Return the answer for every condition, from the results of all variants of all models, in their order."""
    by_condition = grouped(rows, lambda row: row.condition)
    return [_answer(audit, by_condition[audit.condition]) for audit in audits(rows)]


def _answer(audit: ConditionAudit, rows: Sequence[Result]) -> Answer:
    by_variant = grouped(rows, lambda row: row.variant)
    lines = {variant: _attack_row(audit.extraction, alike) for variant, alike in by_variant.items()}
    inapplicable = {name for name, alike in by_variant.items() if all(map(_is_inapplicable, alike))}
    others = {variant for variant in lines if variant == UNATTACKED or is_control(variant)} | inapplicable
    attacks = [row for variant, row in lines.items() if variant not in others]
    attacks.sort(key=_place)
    known = [row for row in rows if row.variant == UNATTACKED]
    return Answer(
        audit=audit,
        attacks=attacks,
        controls=[lines[name] for name in CONTROLS if name in lines],
        has_message=any(row.owner and (row.word or not isnan(row.reading)) for row in rows),
        has_bits=any(row.bits for row in rows if row.extraction == audit.extraction),
        scenes=len({row.scene for row in known}),
        seeds=len({row.seed for row in known}),
    )


def _place(row: AttackRow) -> tuple[int, float, str]:
    """Return the place of an attack: by damage, then without photographs by fidelity, and last those that failed."""
    if not isnan(row.damage):
        return 0, row.damage, row.attack
    return (2, 0.0, row.attack) if isnan(row.fidelity) else (1, -row.fidelity, row.attack)


def _is_inapplicable(row: Result) -> bool:
    """Return whether an attack has nothing to act on in a model."""
    return row.failure.startswith("not applicable")


def _attack_row(extraction: str, alike: Sequence[Result]) -> AttackRow:
    """Return one variant over all scenes; `extraction` is that of the owner as published."""
    published = [row for row in alike if row.extraction == extraction]
    adaptive = [row for row in alike if row.owner == ADAPTS]
    first = alike[0]
    drops = scene_means(known_cells(alike, "damage")).values()
    name = display_name(first.variant) if is_control(first.variant) else first.title
    return AttackRow(
        variant=first.variant,
        attack=title_with_damage(name, first.wanted, *drops),
        damage=_mean(alike, "damage"),
        fidelity=_mean(alike, "fidelity"),
        level=_level(published or alike),
        legibility=_mean(published, "legibility"),
        p=max((row.p for row in published if not isnan(row.p)), default=nan),
        published=_words(published, least=not is_control(first.variant)),
        adaptive=_words(adaptive),
        failure=next((row.failure for row in alike if row.failure and not row.word), ""),
    )


def _level(rows: Sequence[Result]) -> float:
    """Return the message's mean PSNR, or mean reading; the scene's PSNR if there is no message."""
    if any(not isnan(row.reading) for row in rows):
        return _mean(rows, "reading")
    levels = [(row.message_values if row.extraction else row.scene_values).get("psnr", nan) for row in rows]
    known = {(row.scene, row.seed): level for row, level in zip(rows, levels, strict=True) if not isnan(level)}
    return float(np.mean([*scene_means(known).values()])) if known else nan


def _mean(rows: Sequence[Result], field: str) -> float:
    """Return the mean over scenes of a number, of the means over their seeds; NaN if it is known nowhere."""
    known = known_cells(rows, field)
    return float(np.mean([*scene_means(known).values()])) if known else nan


def _words(rows: Sequence[Result], *, least: bool = True) -> str:
    """Return the word that says least of the message, or most; of several models that differ, in how many."""
    words = Counter(row.word for row in rows if row.word)
    if not words:
        return ""
    in_order = sorted(words, key=IN_ORDER.index, reverse=least)
    word = in_order[0]
    return word if len(words) == 1 else f"{word} in {words[word]} of {words.total()}"


def _scanned(scans: Sequence[Mapping[str, str]]) -> tuple[str, str]:
    """Return whether scans suspect a message before and after GSPure; of several models, in how many."""
    texts = []
    for when in ("before", "after"):
        answers = [_DETECTED[scan[when]] for scan in scans]
        texts.append(answers[0] if len(answers) == 1 else f"found in {answers.count('found')} of {len(answers)}")
    before, after = texts
    return before, f"by a scan of the file without a key; after GSPure: {after}"
