"""Tables of numbers as CSV, of which a number that is not known is an empty cell."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from gspure.artifacts import verify, write_text
from gspure.errors import InputError, reading

Cell = str | float | None
Row = TypeVar("Row")


def write_sheet(path: Path, header: Sequence[str], rows: Iterable[Iterable[Cell]]) -> None:
    """Write the rows below their header, whole or not at all; NaN and None are empty cells."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(header)
    table.writerows([_plain(cell) for cell in row] for row in rows)
    write_text(path, text.getvalue())


def read_sheet(path: Path, header: Sequence[str], content: str, row: Callable[..., Row]) -> list[Row]:
    """Return what `row` makes of the cells of every row, which are texts.

    Raises
    ------
    InputError
        If the file cannot be read, has another header, or `row` fails with ValueError or TypeError.

    """
    verify(path)
    with (
        reading(path, content),
        path.open(encoding="utf-8", newline="") as stream,
    ):
        found, *rows = list(csv.reader(stream)) or [[]]
        if found != [*header]:
            raise InputError(path, "header", expected=",".join(header), found=",".join(found))
        return [row(*cells) for cells in rows]


def number(cell: str) -> float:
    """Return the number in a cell; NaN if it is empty."""
    return float(cell) if cell else math.nan


def _plain(cell: Cell) -> str:
    if isinstance(cell, float):
        return "" if math.isnan(cell) else f"{cell:.6g}"
    return "" if cell is None else str(cell)
