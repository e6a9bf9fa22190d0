"""Typed tables as CSV: the one codec of all result files.

The rows of a table are of one kind, a NamedTuple, whose annotations name and type the columns. A nested NamedTuple
takes one column per field (``drop_mean``, ``drop_low``, ...), a mapping of metrics one per metric of
`gspure.evaluation.metrics.METRICS`. Numbers have every digit, so that they are read back unchanged; NaN and
None are empty cells. Numbers out of the `Range` of a column are refused, such as a negative count.
"""

import csv
import io
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

from gspure.artifacts import verify, write_text
from gspure.errors import InputError, reading
from gspure.evaluation.metrics import METRICS
from gspure.settings import Range

Row = TypeVar("Row")
Key = TypeVar("Key")
Cells = Iterator[str]


class PerMetric(NamedTuple):
    """Annotation of a mapping from metric to value: the columns it takes."""

    column: str = "{}"  # name of a column; the braces stand for the metric
    complete: bool = False  # whether to refuse empty cells
    differences: bool = False  # whether values are differences, which the limits of metrics do not bound


Values = Annotated[Mapping[str, float], PerMetric()]  # metrics by name


def grouped(rows: Iterable[Row], key: Callable[[Row], Key]) -> dict[Key, list[Row]]:
    """Return the rows of each key, which need not be adjacent; keys are in the order of their first row."""
    groups: dict[Key, list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


class _Field(NamedTuple):
    columns: list[str]
    write: Callable[[Any], list[str]]
    read: Callable[[Cells], Any]


def write_table(path: Path, kind: type[Row], rows: Iterable[Row]) -> None:
    """Write one CSV row per item below a header, whole or not at all, with a checksum beside it."""
    fields = _fields(kind)
    cells = ([cell for name, field in fields.items() for cell in field.write(getattr(row, name))] for row in rows)
    write_text(path, csv_text(header(kind), cells), checksum=True)


def read_table(path: Path, kind: type[Row]) -> list[Row]:
    """Read what `write_table` has written.

    Raise `InputError` if the file cannot be read, has other columns, or a cell has the wrong type, or a value
    that is impossible in its column.
    """
    verify(path)
    fields, columns = _fields(kind).values(), header(kind)
    with reading(path, f"a table of {kind.__name__} rows"), path.open(encoding="utf-8", newline="") as stream:
        first, *rows = list(csv.reader(stream, strict=True)) or [[]]
        if first != columns:
            raise InputError(path, "header", expected=",".join(columns), found=",".join(first))
        for row in rows:
            if len(row) != len(columns):
                raise InputError(path, "row", expected=f"{len(columns)} cells", found=f"{len(row)}")
        return [kind(*(field.read(cells) for field in fields)) for cells in map(iter, rows)]


def header(kind: type[Row]) -> list[str]:
    """Return the columns of a table of these rows."""
    return [column for field in _fields(kind).values() for column in field.columns]


def csv_text(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return rows below a header as CSV."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    table.writerows(rows)
    return text.getvalue()


def _fields(kind: type) -> dict[str, _Field]:
    hints = get_type_hints(kind, include_extras=True)
    return {name: _field(name, hint) for name, hint in hints.items()}


def _field(name: str, hint: Any) -> _Field:
    limits = None
    if get_origin(hint) is Annotated:
        hint, extra = get_args(hint)
        if isinstance(extra, PerMetric):
            return _metrics(extra)
        limits = extra
    if get_origin(hint) is Literal:
        return _Field([name], lambda value: [value], lambda cells: _one_of(next(cells), get_args(hint)))
    inner = [argument for argument in get_args(hint) if argument is not NoneType] or [hint]
    if hasattr(inner[0], "_fields"):
        return _nested(name, inner[0], optional=NoneType in get_args(hint))
    read = _TEXTS.get(hint) or _reader(hint, limits or _LIMITS[hint])
    return _Field([name], lambda value: [_text(value)], lambda cells: read(next(cells)))


def _nested(name: str, kind: type, *, optional: bool) -> _Field:
    parts = {part: _field(f"{name}_{part}", hint) for part, hint in get_type_hints(kind, include_extras=True).items()}
    columns = [column for field in parts.values() for column in field.columns]

    def write(value: Any) -> list[str]:
        if value is None:
            return [""] * len(columns)
        return [cell for part, field in parts.items() for cell in field.write(getattr(value, part))]

    def read(cells: Cells) -> Any:
        texts = [next(cells) for _ in columns]
        if optional and not any(texts):
            return None
        remaining = iter(texts)
        return kind(*(field.read(remaining) for field in parts.values()))

    return _Field(columns, write, read)


def _metrics(columns: PerMetric) -> _Field:
    """Return the columns of a mapping; a mapping of which nothing is known is read as an empty one."""
    names = {metric: columns.column.format(metric) for metric in METRICS}

    def write(values: Mapping[str, float]) -> list[str]:
        return [_text(values.get(metric, math.nan)) for metric in names]

    def read(cells: Cells) -> dict[str, float]:
        texts = {metric: next(cells) for metric in names}
        values = {metric: _number(text, _LIMITS[float]) for metric, text in texts.items() if text or columns.complete}
        for metric, value in values.items() if not columns.differences else ():
            METRICS[metric].require(value)
        return values

    return _Field([*names.values()], write, read)


def _reader(hint: Any, limits: Range) -> Callable[[str], Any]:
    """Return the reader of a number, which may be unknown unless it is an int."""
    unknown = {float: math.nan}.get(hint)
    return lambda text: unknown if not text and hint is not int else _number(text, limits)


def _number(text: str, limits: Range) -> float:
    number = limits.parse(text)
    if number is None or (math.isinf(number) and "inf" not in text):
        raise ValueError(f"{text!r} is not {limits.expected}")
    return number


def _one_of(text: str, choices: tuple[str, ...]) -> str:
    if text not in choices:
        raise ValueError(f"{text!r} is not one of {', '.join(map(repr, choices))}")
    return text


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value)).removesuffix(".0")
    return "" if value is None else str(value)


_TEXTS: Final[Mapping[Any, Callable[[str], Any]]] = {
    str: str,
    bool | None: lambda text: {"true": True, "false": False, "": None}[_one_of(text, ("true", "false", ""))],
}
_COUNT: Final = Range(0, 2**53)
_LIMITS: Final[Mapping[Any, Range]] = {int: _COUNT, int | None: _COUNT, float: Range(-math.inf, math.inf)}
