"""One model of a table, rendered as Markdown or LaTeX."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from gspure.metrics.statistics import LEVEL, Interval
from gspure.text import UNKNOWN, decimal

_LATEX: Final = {ord(character): f"\\{character}" for character in "&%$#_{}"} | str.maketrans(
    {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}"}
    | {">": r"\textgreater{}", "−": "$-$", "–": "--", "∞": r"$\infty$", "≤": r"$\le$", "≥": r"$\ge$", "†": r"\dag{}"}
)


class Cell(NamedTuple):
    """One cell of a table."""

    text: str = UNKNOWN
    detail: str = ""  # small print after the text: an interval, a change
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


class Row(NamedTuple):
    """The cells of a row, one per column."""

    cells: Sequence[Cell]
    kind: Literal["", "best", "control"] = ""
    begins: bool = False  # whether a block of rows begins here


@dataclass(frozen=True)
class Table:
    """A table with its title and the note that explains its columns."""

    title: str
    columns: Sequence[Column]
    rows: Sequence[Row]
    note: str = ""

    @property
    def main_first(self) -> list[tuple[int, Column]]:
        """The columns with their numbers, main ones first."""
        return sorted(enumerate(self.columns), key=lambda column: not column[1].main)

    def markdown(self) -> str:
        """Return a Markdown table whose columns are aligned in plain text, too."""
        lines = [[column.full_title for column in self.columns]]
        lines += [[f"**{cell}**" if cell.best else str(cell) for cell in row.cells] for row in self.rows]
        lines = [[text.replace("|", r"\|") for text in line] for line in lines]
        widths = [max(3, *map(len, texts)) for texts in zip(*lines, strict=True)]
        signs = [f"<{width}" if words else f">{width}" for width, words in zip(widths, self._words, strict=True)]
        rule = ["-" * (width - 1) + "-:"[not words] for width, words in zip(widths, self._words, strict=True)]
        padded = [map(format, line, signs) for line in (lines[0], rule, *lines[1:])]
        return "\n".join(f"| {' | '.join(line)} |" for line in padded)

    def latex(self) -> str:
        """Return a booktabs ``tabular``, below its note as a comment."""
        lines = ["% Needs \\usepackage{booktabs}.", *(f"% {line}" for line in self.note.splitlines())]
        lines += [r"\begin{tabular}{" + "".join("l" if words else "r" for words in self._words) + "}", r"\toprule"]
        texts = [[column.full_title for column in self.columns], *([*map(str, row.cells)] for row in self.rows)]
        heading, *body = (" & ".join(text.translate(_LATEX) for text in line) + r" \\" for line in texts)
        lines.append(heading)
        for i, (row, line) in enumerate(zip(self.rows, body, strict=True)):
            lines += [r"\midrule"] * (row.begins or not i) + [line]
        return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])

    @property
    def _words(self) -> list[bool]:
        """Whether each column holds words."""
        return [column.text or not i for i, column in enumerate(self.columns)]


def markdown_document(sections: Mapping[str, Sequence[Table]]) -> str:
    """Return tables below the headings of their sections; a note that several share stands below the last of them."""
    last = {table.note: table for tables in sections.values() for table in tables}
    lines: list[str] = []
    for heading, tables in sections.items():
        lines += [f"## {heading}", ""]
        for table in tables:
            lines += [f"### {table.title}", "", table.markdown(), ""]
            lines += [table.note, ""] if last[table.note] is table and table.note else []
    return "\n".join(lines)


def interval(value: Interval | None, scenes: int, text: Callable[[float], str] = decimal) -> Cell:
    """Return a mean with its 95% interval in brackets, or with the range of fewer than six scenes in parentheses.

    Its scenes are counted if they are fewer than `scenes`, those that the place of the cell states.
    """
    if value is None:
        return Cell()
    low, high = text(value.low), text(value.high)
    spread = f"[{low}, {high}]" if value.level >= LEVEL else f"({low} to {high})" if value.scenes > 1 else ""
    return Cell(text(value.mean), f"{spread} {few(value.scenes, scenes)}".strip())


def few(measured: int, scenes: int) -> str:
    """Return the count of scenes in parentheses if it is below `scenes`."""
    return f"({measured} of {scenes} scene{'s' * (scenes != 1)})" if measured < scenes else ""
