"""The table of one condition and owner: what is left of the message after every attack, and what the attack costs."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

from gspure.evaluation.outcomes import title_with_damage
from gspure.evaluation.results import ADAPTS, IN_ORDER, Result, known_cells
from gspure.grouping import grouped
from gspure.metrics.names import UNATTACKED, display_name, extraction_name, is_control
from gspure.metrics.statistics import Interval, known_interval, scene_means
from gspure.report.table import Cell, Column, Table, TableRow, interval
from gspure.text import UNKNOWN, decimal, p_value, percent, significant

_NOTE: Final = (
    "Means over scenes; in parentheses the smallest and largest value of a scene, in brackets, from six scenes on, the "
    "95% interval. Damage: drop of the scene's PSNR against photographs after the best map of colours, where the "
    "model covered the image; uncovered: the share where it does so no longer. Fidelity: PSNR against the unattacked, "
    "without photographs. T: trace, the mean correlation of the extraction's gradients with the message's. Legible: R, "
    "the share of the message's blocks that can be recognized. p: probability of as much by chance, the largest of "
    "a scene. †: the attack changed nothing that this extraction reads."
)


def evidence_tables(rows: Sequence[Result]) -> list[Table]:
    """Return a table for each owner and detector of one condition."""
    return [_table(name, alike) for name, alike in grouped(rows, lambda row: row.extraction).items() if name]


def _table(extraction: str, rows: Sequence[Result]) -> Table:
    scenes = len({row.scene for row in rows})
    columns = {"attack": Column("attack"), "damage": Column("damage dB"), "fidelity": Column("fidelity dB")}
    columns |= {"coverage_lost": Column("uncovered", main=False)}
    columns |= {"scene": Column("PSNR", "scene", main=False), "message": Column("PSNR", "message", main=False)}
    columns |= {
        "trace": Column("T", main=False),
        "legibility": Column("legible"),
        "bits": Column("bits"),
        "reading": Column("reading"),
    }
    columns |= {"p": Column("p"), "word": Column("left", text=True)}
    lines = [_cells(alike, scenes) for alike in grouped(rows, lambda row: row.variant).values()]
    shown = [name for name in columns if any(line[name].text != UNKNOWN for line in lines)]
    title = (
        f"What is left: {'message, if the owner adapts' if rows[0].owner == ADAPTS else extraction_name(extraction)}"
    )
    table_rows = [
        TableRow([line[name] for name in shown], "control" if is_control(variant) else "")
        for variant, line in zip(grouped(rows, lambda row: row.variant), lines, strict=True)
    ]
    return Table(title, [columns[name] for name in shown], table_rows, _NOTE)


def _cells(alike: Sequence[Result], scenes: int) -> dict[str, Cell]:
    """Return the cells of one variant, by column."""
    first = alike[0]
    name = display_name(first.variant) if is_control(first.variant) else first.title
    drops = scene_means(known_cells(alike, "damage"))
    title = title_with_damage(name, first.wanted, *drops.values())
    is_unaffected = first.variant != UNATTACKED and all(row.reached is False for row in alike)
    number = partial(_number, alike, scenes=scenes)
    ps = [*known_cells(alike, "p").values()]
    bits = [f"{row.correct} of {row.bits}" for row in alike if row.bits]
    words = [word for word in IN_ORDER if any(row.word == word for row in alike)]
    return {
        "attack": Cell(f"{title} †" if is_unaffected else title),
        "damage": number("damage"),
        "fidelity": number("fidelity"),
        "coverage_lost": number("coverage_lost", text=percent),
        "scene": interval(_of_metric(alike, "scene_values"), scenes),
        "message": interval(_of_metric(alike, "message_values"), scenes),
        "trace": number("trace"),
        "legibility": number("legibility", text=lambda value: percent(value, 0)),
        "bits": Cell(", ".join(dict.fromkeys(bits)) or UNKNOWN),
        "reading": number("reading", text=significant),
        "p": Cell(p_value(max(ps)) if ps else UNKNOWN),
        "word": Cell(", ".join(words) or UNKNOWN),
    }


def _number(rows: Sequence[Result], field: str, *, scenes: int, text: Callable[[float], str] = decimal) -> Cell:
    """Return the mean of a field over scenes."""
    return interval(known_interval(known_cells(rows, field)), scenes, text)


def _of_metric(rows: Sequence[Result], field: str) -> Interval | None:
    """Return the mean PSNR of scene or message over scenes."""
    levels = {(row.scene, row.seed): getattr(row, field).get("psnr") for row in rows}
    return known_interval({cell: level for cell, level in levels.items() if level is not None})
