"""What attacks take from the message at equal damage to the scene, averaged over scenes: a table per scheme."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gspure.evaluation.outcomes import MESSAGE, REFERENCE, SCENE, Outcome, ordered
from gspure.evaluation.sheet import read_sheet, write_sheet
from gspure.evaluation.statistics import (
    MATCHED_DAMAGES,
    Interval,
    NotReached,
    by_scene,
    matched_message_drop,
    mean_interval,
)

Sweeps = Mapping[str, Sequence[str]]
"""Variants that are one attack at several strengths, by a name for all of them."""

Curves = dict[tuple[str, int], list[tuple[float, float]]]
"""What scene and message lost, dB, at every strength, by scene and seed."""

UNATTACKED: Final = (0.0, 0.0)
"""One point of every sweep, since every strength can go down to doing nothing."""

HEADER: Final = (
    *("scheme", "extraction", "sweep", "strengths", "damage"),
    *(f"drop_{part}" for part in Interval._fields),
    "gentle",
)

LEGEND: Final = """\
What the message loses, in dB, where the scene may lose what the column says: mean over scenes, by interpolation between
the strengths that were tried, and between none and the weakest. Brackets: 95 % interval over scenes; parentheses: range
of fewer than six. ≥: in some scene no strength that was tried damages the scene as much, and the one that takes the
most from the message counts. Bold: the most."""


class Matched(NamedTuple):
    """One sweep at one damage to the scene."""

    scheme: str
    extraction: str
    """The target that shows the message."""

    sweep: str
    strengths: int
    damage: float
    """How far the scene's PSNR may fall, dB."""

    drop: Interval
    """How far the message's then falls, dB, over scenes and seeds; at least, where some of them are gentle."""

    gentle: int
    """On how many models no strength that was tried damages the scene as much. There the best of them counts."""

    def __str__(self) -> str:
        return ("≥ " if self.gentle else "") + str(self.drop)


def match(outcomes: Sequence[Outcome], sweeps: Sweeps) -> list[Matched]:
    """Compare sweeps at `MATCHED_DAMAGES`, for every scheme and extraction of the message.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Sorted by scheme (`gspure.evaluation.outcomes.collect`).
    sweeps : mapping
        Names of variants; those that a scheme lacks or that failed on its models are passed over. Attacks in none of
        them are sweeps of one strength.

    """
    found = []
    sweeps = completed(sweeps, (o.variant for o in outcomes if o.variant != REFERENCE and not o.is_control))
    for scheme, group in groupby(outcomes, key=lambda o: o.scheme):
        ours = list(group)
        for extraction in ordered({target for o in ours for target in o.messages}):
            for name, variants in sweeps.items():
                curves = _drops([o for o in ours if o.variant in variants], extraction)
                strengths = max(map(len, curves.values()), default=0)
                found += [
                    Matched(scheme, extraction, name, strengths, damage, *_mean_drop(curves, damage))
                    for damage in MATCHED_DAMAGES
                    if curves
                ]
    return found


def completed(sweeps: Sweeps, variants: Iterable[str]) -> dict[str, Sequence[str]]:
    """Return the sweeps, and every variant that is in none of them as one of a single strength."""
    swept = {variant for names in sweeps.values() for variant in names}
    return {**sweeps, **{variant: [variant] for variant in variants if variant not in swept}}


def write_matched(path: Path, rows: Iterable[Matched]) -> None:
    """Write one CSV row per sweep and damage."""
    write_sheet(path, HEADER, ([*row[:5], *row.drop, row.gentle] for row in rows))


def read_matched(path: Path) -> list[Matched]:
    """Read what `write_matched` has written, or raise `InputError`."""
    return read_sheet(path, HEADER, "a table of attacks at equal damage", _row)


def matched_markdown(rows: Sequence[Matched]) -> str:
    """Return one Markdown table per scheme and extraction, and what it says."""
    if not rows:
        return "No attack on a model with a message was run at several strengths.\n"
    lines: list[str] = []
    for scheme, extraction, table in by_extraction(rows):
        lines += [f"### {scheme}" + ("" if extraction == MESSAGE else f" / {extraction}"), ""]
        lines += ["| attack | strengths | " + " | ".join(f"{damage:g} dB" for damage in MATCHED_DAMAGES) + " |"]
        lines += ["| --- |" + " ---: |" * (1 + len(MATCHED_DAMAGES))]
        best = most(table)
        for cells in table:
            shown = [f"**{cell}**" if cell in best else str(cell) for cell in cells]
            lines.append("| " + " | ".join([cells[0].sweep, str(cells[0].strengths), *shown]) + " |")
        lines.append("")
    return "\n".join([*lines, LEGEND, ""])


def by_extraction(rows: Iterable[Matched]) -> Iterator[tuple[str, str, list[list[Matched]]]]:
    """Yield scheme, extraction and the rows of their table: the cells of each sweep, by damage."""
    for (scheme, extraction), group in groupby(rows, key=lambda row: (row.scheme, row.extraction)):
        yield scheme, extraction, [list(cells) for _, cells in groupby(group, key=lambda row: row.sweep)]


def most(table: Sequence[Sequence[Matched]]) -> list[Matched]:
    """Return, for each damage, the cell of the sweep that takes the most."""
    return [max(column, key=lambda cell: cell.drop.mean) for column in zip(*table, strict=True)]


def _row(scheme: str, extraction: str, sweep: str, strengths: str, damage: str, *cells: str) -> Matched:
    *numbers, scenes, gentle = cells
    mean, low, high, level = map(float, numbers)
    drop = Interval(mean, low, high, level, int(scenes))
    return Matched(scheme, extraction, sweep, int(strengths), float(damage), drop, int(gentle))


def _drops(variants: Sequence[Outcome], extraction: str) -> Curves:
    """Return for every scene and seed its points: what scene and message lost, of variants of which both are known."""
    curves: Curves = {}
    for o in variants:
        drops = (o.psnr_drop(SCENE), o.psnr_drop(extraction))
        if not any(map(math.isnan, drops)):
            curves.setdefault((o.scene, o.seed), []).append(drops)
    return curves


def _mean_drop(curves: Curves, damage: float) -> tuple[Interval, int]:
    """Return the mean drop of the message, and in how many curves the sweep is too gentle to do the damage."""
    found = {cell: drop_within(points, damage) for cell, points in curves.items()}
    drops = by_scene({cell: drop for cell, (drop, _) in found.items()})
    return mean_interval(drops), sum(gentle for _, gentle in found.values())


def drop_within(points: Sequence[tuple[float, float]], damage: float) -> tuple[float, bool]:
    """Return what the message loses if the scene may lose `damage`, in dB, and whether no strength does that damage.

    `points` is what scene and message lose in one model, by strength. Where all are gentler, the one that takes the
    most from the message counts.
    """
    scene, message = np.array([UNATTACKED, *points]).T
    drop = matched_message_drop(scene, message, damage)
    return (float(message.max()), drop is NotReached.TOO_GENTLE) if isinstance(drop, NotReached) else (drop, False)
