"""What people read of a result or of work under way: numbers as text, facts, warnings, progress."""

import os
import sys
import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from math import isinf, isnan
from typing import Final, TextIO, TypeVar

from gspure.errors import printable

Item = TypeVar("Item")

_SECONDS_BETWEEN_LINES = 10.0

UNKNOWN: Final = "–"
_LONG: Final = 1e6  # numbers from here on have an exponent

quiet = False  # whether progress is left out; warnings are not
_warned: list[set[str]] = []  # the warnings of each command that is running


def say(message: str) -> None:
    """Print one plain line of progress to standard error."""
    if not quiet:
        tell(message)


def warn(message: str) -> None:
    """Print a warning to standard error; during a command, each of them once."""
    if not any(message in warned for warned in _warned):
        tell(f"warning: {message}")
    for warned in _warned:
        warned.add(message)


@contextmanager
def warnings_in_lines() -> Iterator[None]:
    """Print Python's warnings from the block once each, in one line, when it ends; none if it fails, with a reason."""
    _warned.append(set())
    try:
        with warnings.catch_warnings(record=True) as caught:
            yield
    finally:
        _warned.pop()
    for text in dict.fromkeys(_text(warning) for warning in caught):
        warn(text)


def _text(warning: warnings.WarningMessage) -> str:
    text = printable(str(warning.message))
    return f"results may be wrong: {text}" if issubclass(warning.category, RuntimeWarning) else text


def tell(line: str) -> None:
    """Print a line to standard error; if that fails, as on a full disk, leave out this and all further lines."""
    try:
        print(line, file=sys.stderr, flush=True)  # noqa: T201
    except OSError:
        silence(sys.stderr)


def silence(stream: TextIO) -> None:
    """Discard what is still to be written to a standard stream."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def shows_bars() -> bool:
    """Return whether to draw bars, which need a terminal."""
    return sys.stderr.isatty() and not quiet


def track(items: Sequence[Item], label: str) -> Iterator[Item]:
    """Iterate over `items`, showing how far along the work is."""
    return bar(items, f"{label:<24}") if shows_bars() else _lines(items, label)


def bar(items: Iterable[Item], label: str, total: float | None = None) -> Iterator[Item]:
    """Iterate over `items`, by default as many as there are, with a bar."""
    from rich.console import Console
    from rich.markup import escape as plain
    from rich.progress import track as rich_track

    yield from rich_track(items, plain(label), total, console=Console(stderr=True))


def _lines(items: Sequence[Item], label: str) -> Iterator[Item]:
    began = last = time.monotonic()
    done = 0
    for done, item in enumerate(items, start=1):
        yield item
        now = time.monotonic()
        if now - last > _SECONDS_BETWEEN_LINES:
            say(f"{label}: {done} of {len(items)}")
            last = now
    say(f"{label}: {done} done in {time.monotonic() - began:.1f} s")


class Described(ABC):
    """An object with a few facts: one line in a terminal, a table in a notebook."""

    @property
    @abstractmethod
    def facts(self) -> Mapping[str, str]:
        """The facts to show, by name."""

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}: {fact}' for name, fact in self.facts.items())})"

    def _repr_html_(self) -> str:
        rows = (f"<tr><th>{escape(name)}</th><td>{escape(fact)}</td></tr>" for name, fact in self.facts.items())
        return f"<table><caption>{type(self).__name__}</caption>{''.join(rows)}</table>"


def decimal(value: float, decimals: int = 2) -> str:
    """Return a number with a fixed number of decimals and a true minus sign; zero has no sign, – is unknown."""
    if isnan(value):
        return UNKNOWN
    if isinf(value):
        return "∞" if value > 0 else "−∞"
    return f"{value:z.{decimals}{'f' if abs(value) < _LONG else 'e'}}".replace("-", "−")


def signed(value: float) -> str:
    """Return a difference with its sign; – if it is unknown or infinite."""
    if isnan(value) or isinf(value):
        return UNKNOWN
    return ("" if (text := decimal(value)).startswith("−") else "+") + text


def significant(value: float, digits: int = 3) -> str:
    """Return a number of unknown magnitude with its first digits."""
    return UNKNOWN if isnan(value) else f"{value + 0.0:.{digits}g}".replace("-", "−").replace("inf", "∞")


def percent(share: float, decimals: int = 1) -> str:
    """Return a share in percent, rounded to 0% or 100% only if it is: <0.1% of a few, >99.9% of nearly all."""
    if isnan(share) or isinf(share):
        return UNKNOWN
    text, step = f"{share:z.{decimals}%}", 10.0**-decimals
    if share != 0 and float(text[:-1]) == 0:
        return f"<{step:.{decimals}f}%"
    if share < 1 and float(text[:-1]) == 100:
        return f">{100 - step:.{decimals}f}%"
    return text
