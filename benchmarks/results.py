"""The tables of docs/results.md and docs/contest.md, written from the tables of runs.

``python -m benchmarks.results`` replaces what stands between ``<!-- RUN: KIND -->`` and ``<!-- end -->`` by a table of
`KINDS`. RUN is a folder of docs/results with ``survival.csv``, ``summary.csv`` and ``matched.csv`` from the folder
results/tables of a run, only the files that its tables need; or a table ``RUN.csv`` of a script in benchmarks/. Columns
that these files lack, since they are older than the code, are added first, with unknown values.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import groupby
from math import nan
from pathlib import Path
from statistics import mean
from typing import Final

from benchmarks.contest import SCHEMES, AttackCost, contest
from gspure.evaluation.controls import CLEAN, WRONG_KEY
from gspure.evaluation.csv_tables import csv_text, header, read_table
from gspure.evaluation.matched import Matched
from gspure.evaluation.names import GSPURE, UNATTACKED, condition_name, display_name, extraction_name, wanted_damage
from gspure.evaluation.outcomes import MESSAGE, condition_of
from gspure.evaluation.paper import beside, read_cells
from gspure.evaluation.summary import Summary
from gspure.evaluation.survival import Survival
from gspure.progress import UNKNOWN, decimal, percent, signed
from gspure.report.table import Cell, Column, Row, Table, interval, share
from gspure.report.tables import beside_table
from gspure.schemes.scheme import ADAPTIVE
from gspure.schemes.splats_in_splats.key import ORACLE

PAGE: Final = Path(__file__).parents[1] / "docs" / "results.md"
PAGES: Final = (PAGE, PAGE.with_name("contest.md"))
RUNS: Final = PAGE.with_suffix("")
GENERATED: Final = re.compile(r"(<!-- (?P<run>\w+): (?P<kind>\w+) -->\n).*?(?=<!-- end -->)", re.DOTALL)


def before(run: Path) -> Table:
    """Return PSNR and retrieval before any attack and of the controls, by condition."""
    psnr = {(condition_of(row), row.variant): row for row in read_table(run / "summary.csv", Summary) if _literal(row)}
    rows = []
    for condition in dict.fromkeys(condition for condition, _ in psnr):
        public, clean, wrong = (psnr.get((condition, variant)) for variant in (UNATTACKED, CLEAN, WRONG_KEY))
        scenes = [row.scene if row else None for row in (public, clean)]
        messages = [row.message if row else None for row in (public, wrong, clean)]
        retrieved = [share(row.retrieved.mean) if row and row.retrieved else Cell() for row in (public, clean)]
        means = (*scenes, *messages)
        most = max(mean.scenes for mean in means if mean)
        rows.append(Row([Cell(condition_name(*condition)), *(interval(mean, most) for mean in means), *retrieved]))
    columns = [Column("condition"), Column("public model", "scene:"), Column("clean model", "scene:")]
    columns += [Column(name, "message:") for name in ("right key", "wrong key", "clean model")]
    columns += [Column(name, "retrieved:") for name in ("right key", "clean model")]
    return Table("Before any attack", columns, rows)


def leads(run: Path) -> Table:
    """Return what GSPure does under every condition, and its lead over the strongest other attack at equal damage."""
    means = read_table(run / "summary.csv", Summary)
    retrieved = {_shown(row): row.retrieved for row in means if row.variant == GSPURE}
    swept = _swept(run)
    at = sorted({row.damage for row in swept})
    body = []
    for row in (row for row in read_table(run / "survival.csv", Survival) if row.variant == GSPURE):
        views = retrieved[_shown(row)]
        cells = [
            *(interval(drop, row.scenes) for drop in (row.message_drop, row.scene_drop)),
            Cell(decimal(row.rms_ratio)),
        ]
        cells.append(share(views.mean) if views else Cell())
        alike = [other for other in swept if _shown(other) == _shown(row)]
        cells += [_lead(alike, damage) for damage in at]
        body.append(Row([Cell(_shown(row)), *cells]))
    columns = [Column("condition"), Column("message", "drop of"), Column("scene", "drop of"), Column("RMS ratio")]
    columns += [Column("retrieved"), *(Column(f"{damage:g} dB", "lead at") for damage in at)]
    return Table("GSPure and the strongest other attack", columns, body)


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


def measures(run: Path) -> Table:
    """Return every measure of every attack, by condition and extraction of the message."""
    rows = [row for row in read_table(run / "survival.csv", Survival) if _as_run(row.variant)]
    body = []
    for name, alike in groupby(rows, key=_shown):
        for i, row in enumerate(alike):
            numbers = [
                *(interval(drop, row.scenes) for drop in (row.message_drop, row.scene_drop)),
                Cell(decimal(row.rms_ratio)),
            ]
            numbers += [Cell(decimal(drop.mean if drop else nan)) for drop in (row.ms_ssim_drop, row.nc_drop)]
            numbers += [share(left.mean if left else nan) for left in (row.share_left, row.region_left)]
            gone = row.present - row.survived - row.only_retrieved
            counts = [Cell(str(count)) for count in (row.survived, row.only_retrieved, gone)]
            body.append(Row([Cell("" if i else name), Cell(f"`{row.variant}`"), *numbers, *counts]))
    columns = [
        Column("condition"),
        Column("attack", text=True),
        Column("message", "drop of"),
        Column("scene", "drop of"),
    ]
    columns += [Column("RMS ratio"), Column("MS-SSIM", "drop of"), Column("NC", "drop of")]
    columns += [Column("image", "share left:"), Column("region", "share left:")]
    columns += [Column(name, "message:") for name in ("survives", "retrieved only", "gone")]
    return Table("Attacks", columns, body)


def equal(run: Path) -> Table:
    """Return the message's drop at equal damage to the scene, by condition and extraction of the message.

    Attacks of one strength are left out: they are in the other tables.
    """
    rows = _swept(run)
    at = sorted({row.damage for row in rows})
    body = []
    for name, alike in groupby(rows, key=_shown):
        for i, (sweep, group) in enumerate(groupby(alike, key=lambda row: row.sweep)):
            drops = {row.damage: _reached(row) for row in group}
            cells = [drops.get(damage, Cell()) for damage in at]
            body.append(Row([Cell("" if i else name), Cell(f"`{sweep.partition('@')[0]}`"), *cells]))
    columns = [Column("condition"), Column("attack", text=True), *(Column(f"{d:g} dB", "scene drop of") for d in at)]
    return Table("Drop of the message at equal damage to the scene", columns, body)


def paper(run: Path) -> Table:
    """Return the paper's attacks with its numbers beside ours, or alone if the run has no results."""
    survival = run / "survival.csv"
    return beside_table(beside(read_cells(), read_table(survival, Survival) if survival.exists() else []))


def adaptive(run: Path) -> Table:
    """Return scene and message after attacks, extracted as published and by an owner who trains."""
    rows = [row for row in _script_rows(run) if not row["scheme"].startswith("splats")]
    conditions = dict.fromkeys((row["scheme"], row["protocol"]) for row in rows)
    columns = [Column("attack"), *(Column(condition_name(*condition)) for condition in conditions)]
    return Table("Owners who adapt", columns, _extracted_rows(rows, conditions, (MESSAGE, ADAPTIVE)))


def hardening(run: Path) -> Table:
    """Return scene and message after attacks, as published and hardened, and the weight on rows that are pruned."""
    rows = [row for row in _script_rows(run) if row["scheme"].startswith("splats")]
    conditions = dict.fromkeys((row["scheme"], row["protocol"]) for row in rows)
    columns = [Column("attack"), *(Column(display_name(scheme)) for scheme, _ in conditions)]
    low = [mean(float(row["low_share"]) for row in rows if row["scheme"] == scheme) for scheme, _ in conditions]
    body = _extracted_rows(rows, conditions, (MESSAGE, ADAPTIVE, ORACLE))
    body.append(Row([Cell("*message's weight on rows that `plain_weight` prunes*"), *map(share, low)]))
    return Table("Hardening", columns, body)


def capacity(run: Path) -> Table:
    """Return drops of GSPure and of random pruning by the size of the model."""
    rows = sorted(_script_rows(run), key=lambda row: (row["scheme"], row["protocol"]))
    body = []
    for row in rows:
        drops = [f"{row[f'{by}message_drop']} / {row[f'{by}scene_drop']}".replace("-", "−") for by in BY]
        size = [row["bound"], row["rows"], percent(float(row["removed"]), 0)]
        texts = [condition_name(row["scheme"], row["protocol"]), *size, f"{row['scene']} / {row['message']}", *drops]
        body.append(Row([Cell(text) for text in texts]))
    columns = [Column(title) for title in ("condition", "bound", "rows", "removed", "before: scene / message")]
    columns += [Column(name, "drop of message / scene:") for name in ("GSPure", "random")]
    return Table("Capacity", columns, body)


TABLES: Final = (leads, before, attacks, measures, equal, paper, adaptive, hardening, capacity)
KINDS: Final[Mapping[str, Callable[[Path], Table]]] = {
    **{kind.__name__: kind for kind in TABLES},
    **{scheme: partial(contest, scheme=scheme) for scheme in SCHEMES},
}
ROWS: Final = {"survival": Survival, "summary": Summary, "matched": Matched, "attacks": AttackCost}
"""The kind of the rows of each file of a run."""

BY: Final = ("", "random_")
"""Prefixes of the columns of a capacity table: drops by GSPure, and by random pruning of as many rows."""


def filled(text: str, runs: Path = RUNS) -> str:
    """Return a page with its tables written anew."""
    return GENERATED.sub(lambda m: f"{m[1]}\n{KINDS[m['kind']](runs / m['run']).markdown()}\n\n", text)


def complete(file: Path) -> None:
    """Give a table of a run the columns of today, unknown values where it lacks one."""
    columns, rows = header(ROWS[file.stem]), _dicts(file)
    if [*rows[0]] != columns:
        text = csv_text(columns, ([row.get(column, "") for column in columns] for row in rows))
        file.write_text(text, encoding="utf-8")


def _literal(row: Summary | Survival) -> bool:
    return row.extraction == MESSAGE


def _shown(row: Survival | Summary | Matched) -> str:
    """Return a condition's name, with that of the extraction if it is not the first."""
    name = condition_name(*condition_of(row))
    return name if row.extraction == MESSAGE else f"{name}, {extraction_name(row.extraction)}"


def _script_rows(run: Path) -> list[dict[str, str]]:
    return _dicts(run.with_suffix(".csv"))


def _dicts(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def _extracted_rows(
    rows: Sequence[Mapping[str, str]], conditions: Iterable[tuple[str, str]], extractions: Sequence[str]
) -> list[Row]:
    """Return PSNR of the scene, then of each extraction, by attack and condition; means over seeds."""
    body = []
    for attack in dict.fromkeys(row["attack"] for row in rows):
        cells = [Cell(f"*{attack} model*" if attack == CLEAN else attack if attack == UNATTACKED else f"`{attack}`")]
        for condition in conditions:
            alike = [r for r in rows if (r["scheme"], r["protocol"], r["attack"]) == (*condition, attack)]
            levels = [mean(float(r["scene"]) for r in alike)] if alike else []
            levels += [mean(float(r["message"]) for r in alike if r["extraction"] == e) for e in extractions if alike]
            cells.append(Cell(" / ".join(f"{level:.1f}" for level in levels) or UNKNOWN))
        body.append(Row(cells))
    return body


def _as_run(variant: str) -> bool:
    return variant != UNATTACKED and wanted_damage(variant) is None


def _drops(row: Survival | None) -> Cell:
    if row is None:
        return Cell()
    message, scene = (decimal(drop.mean if drop else nan) for drop in (row.message_drop, row.scene_drop))
    retrieved = f", {row.only_retrieved} retrieved" if row.only_retrieved else ""
    return Cell(
        f"{message} / {scene}", f"({row.survived} of {row.present}{retrieved})" if row.present else f"({UNKNOWN})"
    )


def _swept(run: Path) -> list[Matched]:
    """Return the attacks of several strengths at every damage."""
    return [row for row in read_table(run / "matched.csv", Matched) if row.strengths > 1]


def _lead(rows: Sequence[Matched], damage: float) -> Cell:
    """Return GSPure's drop minus the largest of the other attacks, with the name of that attack.

    The cell is unknown if the drop of any of them is.
    """
    drops = {row.sweep: row.drop.mean for row in rows if row.damage == damage}
    if drops.keys() != {row.sweep for row in rows} or GSPURE not in drops or len(drops) < 2:
        return Cell()
    rival = max(drops.keys() - {GSPURE}, key=lambda sweep: drops[sweep])
    return Cell(signed(drops[GSPURE] - drops[rival]), f"(`{rival}`)")


def _reached(row: Matched) -> Cell:
    """Return a drop, with the damage to the scene where it is not the wanted one."""
    cell = interval(row.drop, row.drop.scenes)
    bound = "≥ " if row.scene_drop < row.damage else "≤ "
    return cell if row.scene_drop == row.damage else Cell(f"{bound}{cell} at {decimal(row.scene_drop)} dB")


if __name__ == "__main__":
    for file in RUNS.glob("*/*.csv"):
        complete(file)
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")
