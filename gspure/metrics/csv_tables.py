"""Typed tables as CSV: the one codec of all result files.

The rows of a table are of one kind, a NamedTuple, whose annotations name and type the columns. A nested NamedTuple
takes one column per field (``drop_mean``, ``drop_low``, ...; if it is `UNPREFIXED`, ``mean``, ...), and a mapping of
metrics one column per metric of `gspure.metrics.image_metrics.METRICS`. Numbers are written with every digit and read
back unchanged; NaN and None are empty cells.
"""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Final, Literal, TypeVar, get_args, get_origin, get_type_hints

from gspure.errors import InputError, reading
from gspure.files import write_text
from gspure.metrics.image_metrics import METRICS

RowType = TypeVar("RowType")

Values = Annotated[Mapping[str, float], "{}"]  # metrics by name: one column each, where the metric replaces the braces
Drops = Annotated[Mapping[str, float], "{}_drop"]
UNPREFIXED: Final = ""  # annotation of a nested NamedTuple: columns without the field's name


def write_table(path: Path, kind: type, rows: Iterable[Any]) -> None:
    """Write one CSV row per item below a header, whole or not at all."""
    write_text(path, csv_text(header(kind), ([_text(value) for _, value in _cells(kind, row)] for row in rows)))


def read_table(path: Path, kind: type[RowType]) -> list[RowType]:
    """Read a table of `write_table`; metrics that it was written without are unknown.

    Raise `InputError` if the file cannot be read, has other columns, or a cell has the wrong type.
    """
    columns = header(kind)
    with reading(path, f"a table of {kind.__name__} rows"), Path(path).open(encoding="utf-8", newline="") as stream:
        first, *rows = list(csv.reader(stream, strict=True)) or [[]]
        absent = {*columns} - {*first}
        if [name for name in columns if name not in absent] != first or not absent <= _metric_columns(kind):
            raise InputError(path, "header", expected=",".join(columns), found=",".join(first))
        for row in rows:
            if len(row) != len(first):
                raise InputError(path, "row", expected=f"{len(first)} cells", found=f"{len(row)}")
        by_column = [dict(zip(first, cells, strict=True)) for cells in rows]
    read_rows = []
    for number, cells in enumerate(by_column, start=1):
        with reading(path, "one of this table", f"row {number}"):
            read_rows.append(_read(kind, (cells.get(name, "") for name in columns)))
    return read_rows


def header(kind: type) -> list[str]:
    """Return the columns of a table of these rows."""
    return [name for name, _ in _cells(kind)]


def _metric_columns(kind: type) -> set[str]:
    """Return the columns of metrics."""
    mappings = [hint for hint in _hints(kind).values() if get_origin(_parts(hint)[0]) is Mapping]
    return {_parts(hint)[1].format(metric) for hint in mappings for metric in METRICS}


def csv_text(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return rows below a header as CSV."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    table.writerows(rows)
    return text.getvalue()


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


def _cells(kind: type, row: Any = None, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield columns and values of a row; without a row, the values are None."""
    for name, hint in _hints(kind).items():
        value = getattr(row, name, None)
        inner, annotation = _parts(hint)
        if get_origin(inner) is Mapping:
            metrics = value or {}
            for metric in METRICS:
                yield annotation.format(metric), metrics.get(metric)
        elif hasattr(inner, "_fields"):
            yield from _cells(inner, value, prefix if annotation == UNPREFIXED else f"{prefix}{name}_")
        else:
            yield f"{prefix}{name}", value


def _read(kind: type, cells: Iterator[str]) -> Any:
    """Return a row from the texts of its cells."""
    values: list[Any] = []
    for hint in _hints(kind).values():
        inner, _ = _parts(hint)
        if get_origin(inner) is Mapping:
            texts = {metric: next(cells) for metric in METRICS}
            values.append({metric: float(text) for metric, text in texts.items() if text})
        elif hasattr(inner, "_fields"):
            parts = [next(cells) for _ in header(inner)]
            is_none = NoneType in get_args(hint) and not any(parts)
            values.append(None if is_none else _read(inner, iter(parts)))
        else:
            values.append(_value(hint, inner, next(cells)))
    return kind(*values)


def _parts(hint: Any) -> tuple[Any, Any]:
    """Return the type of a hint without None, and its annotation."""
    inner = next((argument for argument in get_args(hint) if argument is not NoneType), hint)
    annotation = hint.__metadata__[0] if get_origin(hint) is Annotated else None
    return inner, annotation


def _value(hint: Any, inner: Any, text: str) -> Any:
    if get_origin(hint) is Literal:
        if text not in get_args(hint):
            raise ValueError(f"{text!r} is not one of {', '.join(map(repr, get_args(hint)))}")
        return text
    if not text and NoneType in get_args(hint):
        return None
    if not text and hint is float:
        return math.nan
    return {"true": True, "false": False}[text] if inner is bool else inner(text)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value)).removesuffix(".0")
    return "" if value is None else str(value)
