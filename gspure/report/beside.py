"""Two answers beside each other: the robust radius of each, and what every attack costs and leaves."""

from collections.abc import Iterator, Sequence

from gspure.report.answer import Answer, AttackRow
from gspure.report.table import Cell, Column, Table, TableRow
from gspure.text import UNKNOWN, decimal


def lines_beside(before: Answer, after: Answer, names: Sequence[str]) -> Iterator[str]:
    """Yield the lines of a terminal; `names` are those of the two audits."""
    titles = dict.fromkeys([before.audit.condition.title, after.audit.condition.title])
    yield " / ".join(titles)
    yield ""
    columns = [Column("attack")]
    for name in names:
        columns += [Column("dB", name), Column("left", name, text=True)]
    rows = {row.variant: row.attack for answer in (before, after) for row in answer.attacks}
    lines = []
    for variant, title in rows.items():
        cells = [Cell(title)]
        for answer in (before, after):
            row = next((row for row in answer.attacks if row.variant == variant), None)
            cells += _cells(answer, row)
        lines.append(TableRow(cells))
    yield Table("", columns, lines).markdown()
    yield ""
    for kind in ("message", "readable"):
        radii = [answer.audit.radius(kind) for answer in (before, after)]
        yield f"{kind} radius: {' → '.join(str(radius or UNKNOWN) for radius in radii)}"


def _cells(answer: Answer, row: AttackRow | None) -> list[Cell]:
    """Return what an attack costs the scene, and leaves of the message."""
    if row is None:
        return [Cell(), Cell()]
    return [Cell(decimal(answer.axis(row))), Cell(row.word or UNKNOWN)]
