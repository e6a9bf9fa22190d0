"""The tables of docs/results.md, written from the tables of runs.

``python -m benchmarks.results`` replaces what stands between ``<!-- RUN: KIND -->`` and ``<!-- end -->`` by a table of
`KINDS`. RUN is a folder of docs/results with ``survival.csv``, ``summary.csv`` and ``matched.csv`` from the folder
results/tables of a run; only the files that its tables need.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from itertools import groupby
from math import nan
from pathlib import Path
from typing import Final

from gspure.evaluation.controls import CLEAN, WRONG_KEY
from gspure.evaluation.csv_tables import read_table
from gspure.evaluation.matched import Matched, wanted_damage
from gspure.evaluation.names import condition_name
from gspure.evaluation.outcomes import MESSAGE, UNATTACKED, condition_of
from gspure.evaluation.paper import beside, read_cells
from gspure.evaluation.summary import Summary
from gspure.evaluation.survival import Survival
from gspure.report.table import UNKNOWN, Cell, Column, Row, Table, interval, plain
from gspure.report.tables import beside_table

PAGE: Final = Path(__file__).parents[1] / "docs" / "results.md"
RUNS: Final = PAGE.with_suffix("")
GENERATED: Final = re.compile(r"(<!-- (?P<run>\w+): (?P<kind>\w+) -->\n).*?(?=<!-- end -->)", re.DOTALL)


def before(run: Path) -> Table:
    """Return the PSNR before any attack and of the controls, by condition."""
    psnr = {(condition_of(row), row.variant): row for row in read_table(run / "summary.csv", Summary) if _literal(row)}
    rows = []
    for condition in dict.fromkeys(condition for condition, _ in psnr):
        public, clean, wrong = (psnr.get((condition, variant)) for variant in (UNATTACKED, CLEAN, WRONG_KEY))
        scenes = [row.scene if row else None for row in (public, clean)]
        messages = [row.message if row else None for row in (public, wrong, clean)]
        rows.append(Row([Cell(condition_name(*condition)), *map(interval, (*scenes, *messages))]))
    columns = [Column("condition"), Column("public model", "scene:"), Column("clean model", "scene:")]
    columns += [Column(name, "message:") for name in ("right key", "wrong key", "clean model")]
    return Table("Before any attack", columns, rows)


def attacks(run: Path) -> Table:
    """Return the drops of message and scene after every attack, and in how many scenes the message survives.

    Attacks whose strength was searched are in the table `equal`.
    """
    rows = [row for row in read_table(run / "survival.csv", Survival) if _literal(row) and _as_run(row.variant)]
    conditions = dict.fromkeys(map(condition_of, rows))
    by_cell = {(row.variant, condition_of(row)): row for row in rows}
    body = [
        Row([Cell(f"`{variant}`"), *(_drops(by_cell.get((variant, condition))) for condition in conditions)])
        for variant in dict.fromkeys(row.variant for row in rows)
    ]
    columns = [Column("attack"), *(Column(condition_name(*condition)) for condition in conditions)]
    return Table("Drop of message / scene, scenes in which the message survives", columns, body)


def equal(run: Path) -> Table:
    """Return the message's drop at equal damage to the scene."""
    rows = [row for row in read_table(run / "matched.csv", Matched) if row.extraction == MESSAGE]
    at = sorted({row.damage for row in rows})
    body = []
    for condition, alike in groupby(rows, key=condition_of):
        for i, (sweep, group) in enumerate(groupby(alike, key=lambda row: row.sweep)):
            drops = {row.damage: row for row in group}
            cells = [_reached(drops[damage]) if damage in drops else Cell() for damage in at]
            body.append(
                Row([Cell("" if i else condition_name(*condition)), Cell(f"`{sweep.partition('@')[0]}`"), *cells])
            )
    columns = [Column("condition"), Column("attack", text=True), *(Column(f"{d:g} dB", "scene drop of") for d in at)]
    return Table("Drop of the message at equal damage to the scene", columns, body)


def paper(run: Path) -> Table:
    """Return the paper's attacks with its numbers beside ours, or alone if the run has no results."""
    survival = run / "survival.csv"
    return beside_table(beside(read_cells(), read_table(survival, Survival) if survival.exists() else []))


KINDS: Final[Mapping[str, Callable[[Path], Table]]] = {kind.__name__: kind for kind in (before, attacks, equal, paper)}


def filled(text: str, runs: Path = RUNS) -> str:
    """Return a page with its tables written anew."""
    return GENERATED.sub(lambda m: f"{m[1]}\n{KINDS[m['kind']](runs / m['run']).markdown()}\n\n", text)


def _literal(row: Summary | Survival) -> bool:
    return row.extraction == MESSAGE


def _as_run(variant: str) -> bool:
    return variant != UNATTACKED and wanted_damage(variant) is None


def _drops(row: Survival | None) -> Cell:
    if row is None:
        return Cell()
    message, scene = (plain(drop.mean if drop else nan) for drop in (row.message_drop, row.scene_drop))
    retrieved = f", {row.only_retrieved} retrieved" if row.only_retrieved else ""
    return Cell(
        f"{message} / {scene}", f"({row.survived} of {row.present}{retrieved})" if row.present else f"({UNKNOWN})"
    )


def _reached(row: Matched) -> Cell:
    """Return a drop, with the damage to the scene where it is not the wanted one."""
    cell = interval(row.drop)
    bound = "≥ " if row.gentle else ""
    return cell if row.scene_drop == row.damage else Cell(f"{bound}{cell} at {plain(row.scene_drop)} dB")


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
