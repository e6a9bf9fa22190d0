"""What people read of a result or of work under way: numbers as text, facts, warnings, progress."""

import os
import sys
import time
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TextIO, TypeVar

from gspure.errors import printable

Item = TypeVar("Item")

_SECONDS_BETWEEN_LINES = 10.0


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
