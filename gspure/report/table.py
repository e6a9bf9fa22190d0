"""A table as data, rendered as Markdown."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from gspure.metrics.statistics import LEVEL, Interval
from gspure.text import UNKNOWN, decimal


class Cell(NamedTuple):
    """One cell of a table."""

    text: str = UNKNOWN
    detail: str = ""  # small print after the text: an interval or a change
    best: bool = False  # whether it is the best of its column

    def __str__(self) -> str:
        return f"{self.text} {self.detail}".rstrip()


class Column(NamedTuple):
    """A column; the first of a table names its rows."""

    title: str
    group: str = ""  # a heading shared with neighbouring columns
    text: bool = False  # whether it holds words, aligned left, like the first column
    main: bool = True  # whether a page shows it by default

    @property
    def full_title(self) -> str:
        """The title with its group, for tables with one line of headings."""
        return f"{self.group} {self.title}".strip()


class TableRow(NamedTuple):
    """The cells of a row, one per column."""

    cells: Sequence[Cell]
    kind: Literal["", "best", "control"] = ""
    begins: bool = False  # whether a block of rows begins here


@dataclass(frozen=True)
class Table:
    """A table with its title and the note that explains its columns."""

    title: str
    columns: Sequence[Column]
    rows: Sequence[TableRow]
    note: str = ""

    @property
    def main_first(self) -> list[tuple[int, Column]]:
        """The columns with their indices, main ones first."""
        return sorted(enumerate(self.columns), key=lambda column: not column[1].main)

    def markdown(self) -> str:
        """Return a Markdown table whose columns are aligned in plain text, too."""
        lines = [[column.full_title for column in self.columns]]
        lines += [[f"**{cell}**" if cell.best else str(cell) for cell in row.cells] for row in self.rows]
        lines = [[text.replace("|", r"\|") for text in line] for line in lines]
        widths = [max(3, *map(len, texts)) for texts in zip(*lines, strict=True)]
        signs = []
        rule = []
        for width, is_left in zip(widths, self._are_left, strict=True):
            signs.append(f"<{width}" if is_left else f">{width}")
            end = "-" if is_left else ":"
            rule.append(end.rjust(width, "-"))
        padded = [map(format, line, signs) for line in (lines[0], rule, *lines[1:])]
        return "\n".join(f"| {' | '.join(line)} |" for line in padded)

    @property
    def _are_left(self) -> list[bool]:
        """Whether each column is aligned left: the first column, and columns of words."""
        return [column.text or i == 0 for i, column in enumerate(self.columns)]


def markdown_document(sections: Mapping[str, Sequence[Table]]) -> str:
    """Return tables below the headings of their sections; a note of several tables stands below the last of them."""
    last = {table.note: table for tables in sections.values() for table in tables}
    lines: list[str] = []
    for heading, tables in sections.items():
        lines += [f"## {heading}", ""]
        for table in tables:
            lines += [f"### {table.title}", "", table.markdown(), ""]
            if table.note and last[table.note] is table:
                lines += [table.note, ""]
    return "\n".join(lines)


def interval(value: Interval | None, scenes: int, text: Callable[[float], str] = decimal) -> Cell:
    """Return a mean with its 95% interval in brackets, or with the range of fewer than six scenes in parentheses.

    `scenes` is the number of scenes that the row or the table states: the cell counts its scenes if they are fewer.
    """
    if value is None:
        return Cell()
    spread = ""
    if value.level >= LEVEL:
        spread = f"[{text(value.low)}, {text(value.high)}]"
    elif value.scenes > 1:
        spread = f"({text(value.low)} to {text(value.high)})"
    return Cell(text(value.mean), f"{spread} {scene_count(value.scenes, scenes)}".strip())


def scene_count(measured: int, scenes: int) -> str:
    """Return the number of measured scenes in parentheses if it is below `scenes`; otherwise an empty text."""
    if measured >= scenes:
        return ""
    noun = "scene" if scenes == 1 else "scenes"
    return f"({measured} of {scenes} {noun})"
