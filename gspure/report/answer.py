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
from gspure.evaluation.results import ADAPTS, IN_ORDER, PUBLISHED, OwnerName, Result, known_cells
from gspure.files import Json
from gspure.grouping import grouped
from gspure.metrics.names import CONTROLS, GSPURE, UNATTACKED, WRONG_KEY, display_name, extraction_name
from gspure.metrics.statistics import scene_means
from gspure.metrics.targets import SCENE, is_picture
from gspure.report.audit import Audit, audits
from gspure.scan.verdict import LIKELY, NOTHING, UNLIKE
from gspure.text import UNKNOWN, decimal, p_value, percent, significant

_DETECTED: Final = {LIKELY: "yes", NOTHING: "no", UNLIKE: "unclear"}


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

    @property
    def word(self) -> str:
        """What is left for the owner who adapts, if there is one."""
        return self.adaptive or self.published


@dataclass(frozen=True)
class Answer:
    """The audit of one condition, and its attacks by damage, the controls last."""

    audit: Audit
    attacks: Sequence[AttackRow]
    controls: Sequence[AttackRow]
    has_message: bool
    before: AttackRow | None  # the unattacked model
    scenes: int
    seeds: int

    @property
    def unit(self) -> str:
        """The unit of the message's level: none for readings of a detector."""
        is_psnr = not self.has_message or is_picture(self.audit.extraction)
        return " dB" if is_psnr else ""

    @property
    def has_damage(self) -> bool:
        """Whether there are photographs; otherwise the axis is fidelity."""
        return any(isfinite(row.damage) for row in self.attacks)

    def level(self, value: float) -> str:
        """Return a level of the message as text, without its unit."""
        return decimal(value, 1) if self.unit else significant(value)

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
        owners: dict[OwnerName, str] = {ADAPTS: "owner who adapts", PUBLISHED: "as published"}
        for owner, of_owner in owners.items():
            radius = self.audit.radius(owner=owner)
            if radius:
                yield self._radius(radius), f"robust radius, {of_owner}"
        readable = self.audit.radius("readable")
        if readable:
            yield self._radius(readable), "readable radius"
        yield self._with_wrong_key()
        if scans:
            yield _scanned(scans)
        yield self._evidence()

    def _radius(self, radius: Radius) -> str:
        """Return a radius over the scenes as text, with its range."""
        if isnan(radius.radius):
            return UNKNOWN if radius.exceeds else f"fidelity {decimal(radius.fidelity, 1)} dB"
        if radius.scenes == 1:
            return str(radius)
        high = decimal(radius.high, 1) if isfinite(radius.high) else "more"
        return f"{radius} ({decimal(radius.low, 1)} to {high})"

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
        controls = [f"{row.attack} {row.published}" for row in self.controls if row.published]
        if controls:
            yield f"controls: {', '.join(controls)}"
        yield self.audit.sentence

    def _table(self) -> list[list[str]]:
        """Return the cells of the attacks below their titles."""
        adapts = any(row.adaptive for row in self.attacks)
        name = extraction_name(self.audit.extraction) if self.has_message else SCENE
        titles = ["attack", "damage dB" if self.has_damage else "fidelity dB", f"{name}{self.unit}"]
        if self.has_message:
            titles += ["legible", "p", "as published"]
        if adapts:
            titles.append("owner who adapts")
        table = [titles]
        for row in self.attacks:
            cells = [row.attack, decimal(self.axis(row), 1), self.level(row.level)]
            if self.has_message:
                cells += [percent(row.legibility, 0), p_value(row.p), row.published or UNKNOWN]
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


def _answer(audit: Audit, rows: Sequence[Result]) -> Answer:
    by_variant = grouped(rows, lambda row: row.variant)
    lines = {variant: _attack_row(audit.extraction, alike) for variant, alike in by_variant.items()}
    inapplicable = {name for name, alike in by_variant.items() if all(map(_is_inapplicable, alike))}
    attacks = [row for variant, row in lines.items() if variant not in {UNATTACKED, *CONTROLS, *inapplicable}]
    attacks.sort(key=lambda row: (isnan(row.damage), row.damage, -row.fidelity, row.attack))  # failed ones last
    known = [row for row in rows if row.variant == UNATTACKED]
    return Answer(
        audit=audit,
        attacks=attacks,
        controls=[lines[name] for name in CONTROLS if name in lines],
        has_message=any(row.owner and (row.word or not isnan(row.reading)) for row in rows),
        before=lines.get(UNATTACKED),
        scenes=len({row.scene for row in known}),
        seeds=len({row.seed for row in known}),
    )


def _is_inapplicable(row: Result) -> bool:
    """Return whether an attack has nothing to act on in a model."""
    return row.failure.startswith("not applicable")


def _attack_row(extraction: str, alike: Sequence[Result]) -> AttackRow:
    """Return one variant over all scenes; `extraction` is that of the owner as published."""
    published = [row for row in alike if row.extraction == extraction]
    adaptive = [row for row in alike if row.owner == ADAPTS]
    first = alike[0]
    drops = scene_means(known_cells(alike, "damage")).values()
    name = display_name(first.variant) if first.variant in CONTROLS else first.title
    return AttackRow(
        variant=first.variant,
        attack=title_with_damage(name, first.wanted, *drops),
        damage=_mean(alike, "damage"),
        fidelity=_mean(alike, "fidelity"),
        level=_level(published or alike),
        legibility=_mean(published, "legibility"),
        p=max((row.p for row in published if not isnan(row.p)), default=nan),
        published=_words(published),
        adaptive=_words(adaptive),
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


def _words(rows: Sequence[Result]) -> str:
    """Return the word that says least; of several models that differ, in how many."""
    words = Counter(row.word for row in rows if row.word)
    if not words:
        return ""
    worst = max(words, key=IN_ORDER.index)
    return worst if len(words) == 1 else f"{worst} in {words[worst]} of {words.total()}"


def _scanned(scans: Sequence[Mapping[str, str]]) -> tuple[str, str]:
    """Return whether scans detect a message before and after GSPure; of several models, in how many."""
    texts = []
    for when in ("before", "after"):
        answers = [_DETECTED[scan[when]] for scan in scans]
        texts.append(answers[0] if len(answers) == 1 else f"{answers.count('yes')} of {len(answers)}")
    return " → ".join(texts), "detectable without a key, before and after GSPure"
