"""The tables of docs/contest.md: what attacks leave of the message of one scheme at equal damage to the scene."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

import yaml

from gspure.attacks import find_attack
from gspure.evaluation.controls import LEVEL_CONTROLS
from gspure.evaluation.csv_tables import read_table
from gspure.evaluation.matched import Matched
from gspure.evaluation.names import UNATTACKED, display_name, wanted_damage
from gspure.evaluation.outcomes import BITS, MESSAGE
from gspure.evaluation.summary import Summary
from gspure.report.table import Cell, Column, Row, Table
from gspure.schemes.scheme import ADAPTIVE
from gspure.schemes.splats_in_splats.key import ORACLE

CONFIGURATION: Final = Path(__file__).parents[1] / "config" / "contest.yaml"
OWNERS: Final = {MESSAGE: "literal", ADAPTIVE: "adaptive", ORACLE: "oracle", BITS: "literal"}
DAMAGES: Final = (0.3, 1.0, 2.0)
SCHEMES: Final = (
    *("splats_in_splats", "splats_in_splats_hardened", "gs_hider", "gs_hider_hardened"),
    *("secure_gs", "secure_gs_hardened", "keyss", "marked_clones"),
)


class AttackCost(NamedTuple):
    """The mean cost of one variant, or of all variants of a sweep, over the scenes and seeds of one condition."""

    scheme: str
    protocol: str
    initialization: str
    kind: str  # `variant` or `sweep`
    attack: str
    cpu: float  # s
    memory: float  # peak, MiB


def contest(run: Path, scheme: str) -> Table:
    """Return the message left after every attack, for each owner, by protocol and damage to the scene."""
    matched = [row for row in read_table(run / "matched.csv", Matched) if row.scheme == scheme]
    points = {(row.sweep, row.extraction, row.protocol, row.damage): row for row in matched}
    left = {p: _Left(run, scheme, p) for p in ("shared", "own") if p in {row.protocol for row in matched}}
    names = dict.fromkeys((row.sweep, row.extraction) for row in matched)
    body, last = [], ""
    for sweep, extraction in [*((UNATTACKED, e) for e in dict.fromkeys(e for _, e in names)), *sorted_by_sweep(names)]:
        cells = [Cell("" if sweep == last else f"`{sweep}`"), Cell(OWNERS[extraction])]
        for protocol, of in left.items():
            for damage in DAMAGES:
                point = points.get((sweep, extraction, protocol, damage))
                cells.append(of.after(point) if point else of.gentlest(sweep, extraction))
        body.append(Row([*cells, *(_cost(run, scheme, sweep) if sweep != last else (Cell(""), Cell("")))]))
        last = sweep
    columns = [Column("attack"), Column("owner", text=True)]
    columns += [Column(f"{damage:g} dB", f"{protocol} poses:") for protocol in left for damage in DAMAGES]
    return Table(display_name(scheme), [*columns, Column("CPU-s"), Column("MiB")], body)


def sorted_by_sweep(names: Mapping[tuple[str, str], None]) -> list[tuple[str, str]]:
    """Return attack and extraction with all extractions of one attack together."""
    order = list(dict.fromkeys(sweep for sweep, _ in names))
    return sorted(names, key=lambda name: order.index(name[0]))


class _Left:
    """What is left of the message of one model: above the floor, or in correct bits, and in how many views."""

    def __init__(self, run: Path, scheme: str, protocol: str) -> None:
        self._known = {
            (row.extraction, row.variant): row
            for row in read_table(run / "summary.csv", Summary)
            if (row.scheme, row.protocol) == (scheme, protocol) and row.message
        }

    def gentlest(self, sweep: str, extraction: str) -> Cell:
        """Return the level after the weakest strength, `≥` if it is an attack; nothing if none was measured."""
        damages = self._damages(sweep, extraction)
        if not damages:
            return Cell()
        variant = min(damages, key=damages.__getitem__)
        return self._cell(extraction, self._level(extraction, variant), variant, "≥ " * (variant != UNATTACKED))

    def after(self, point: Matched) -> Cell:
        """Return the level at a damage; `≤` where no strength does this damage, `≥` where the search found more."""
        bound = "≤ " * (point.scene_drop < point.damage) + "≥ " * (point.scene_drop > point.damage)
        level = self._level(point.extraction) - point.drop.mean
        return self._cell(point.extraction, level, self._variant(point), bound)

    def _level(self, extraction: str, variant: str = UNATTACKED) -> float:
        """Return the message's PSNR above the highest control without a message, or the share of correct bits."""
        controls = [self._known.get((extraction, control)) for control in LEVEL_CONTROLS] if extraction != BITS else []
        floor = max((row.message.mean for row in controls if row and row.message), default=0.0)
        message = self._known[extraction, variant].message
        return message.mean - floor if message else math.nan

    def _variant(self, point: Matched) -> str:
        """Return the strongest variant of a sweep that does at most the damage, or else the gentlest."""
        damages = self._damages(point.sweep, point.extraction)
        wanted = [name for name in damages if wanted_damage(name) == point.damage]
        gentle = sorted((name for name in damages if damages[name] <= point.damage), key=damages.__getitem__)
        return [*sorted(damages, key=lambda name: -damages[name]), *gentle, *wanted][-1]

    def _damages(self, sweep: str, extraction: str) -> dict[str, float]:
        """Return the scene's drop after the variants of a sweep."""
        scene = self._known[extraction, UNATTACKED].scene
        rows = {n: self._known[extraction, n] for n in variants(sweep) if (extraction, n) in self._known}
        return {name: scene.mean - row.scene.mean for name, row in rows.items() if scene and row.scene}

    def _cell(self, extraction: str, level: float, variant: str, bound: str) -> Cell:
        retrieved = self._known[extraction, variant].retrieved
        views = f"({round(100 * retrieved.mean)}%)" if retrieved else ""
        return Cell(f"{bound}{level:.1f}".replace("-0.0", "0.0").replace("-", "−"), views)


@cache
def variants(sweep: str) -> set[str]:
    """Return the variants of a sweep, or the variant itself."""
    configured = yaml.safe_load(CONFIGURATION.read_text(encoding="utf-8"))["variants"]
    names = {sweep}
    for name, settings in configured.items():
        attack = settings.get("attack", name)
        if sweep in {attack, find_attack(attack).sweep}:
            names |= {name, *(f"{name}@{damage:g}dB" for damage in settings.get("damage", ()))}
    return names


def _cost(run: Path, scheme: str, attack: str) -> Iterator[Cell]:
    """Yield CPU time and peak memory, means over both protocols, of all strengths of an attack."""
    rows = [row for row in read_table(run / "attacks.csv", AttackCost) if (row.scheme, row.attack) == (scheme, attack)]
    rows = [row for row in rows if row.kind == "sweep"] or rows
    for name, digits in (("cpu", 1), ("memory", 0)):
        yield Cell(f"{sum(getattr(row, name) for row in rows) / len(rows):.{digits}f}") if rows else Cell()
