"""Terminal output: numbers as text, facts, warnings, progress."""

import json
import os
import sys
import time
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from shutil import get_terminal_size
from typing import Final, TextIO, TypeVar

from gspure.errors import printable

Item = TypeVar("Item")

EVENTS: Final = "GSPURE_EVENTS"
"""Environment variable of a named pipe, which `gspure audit` reads."""
JOB: Final = "GSPURE_JOB"
"""Environment variable of a job of the workflow: its log, by which `gspure audit` knows it."""

_SECONDS_BETWEEN_LINES = 10.0
_SECONDS_BETWEEN_EVENTS: Final = 0.5
_ERASE: Final = "\r\x1b[2K"  # the line on which a terminal's cursor is

quiet = False  # whether progress is left out; warnings are not
_shown = ""  # the line of `show` on the terminal
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
    _write(f"{line}\n")


def show(line: str) -> None:
    """Show a line on the terminal until the next one, of `show` or `tell`, takes its place; an empty line erases it.

    A line that is too long for the terminal loses its middle.
    """
    global _shown  # noqa: PLW0603
    columns = get_terminal_size().columns - 1
    if len(line) > columns:
        kept = columns // 2
        line = f"{line[: columns - kept - 1]}…{line[-kept:]}"
    if line != _shown:
        _write(line)
        _shown = line


def _write(text: str) -> None:
    """Write to standard error, in place of the line of `show`."""
    global _shown  # noqa: PLW0603
    erase = _ERASE if _shown else ""
    _shown = ""
    try:
        print(f"{erase}{text}", end="", file=sys.stderr, flush=True)  # noqa: T201
    except OSError:
        silence(sys.stderr)


def silence(stream: TextIO) -> None:
    """Discard what is still to be written to a standard stream."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def shows_bars() -> bool:
    """Return whether to draw bars, which need a terminal."""
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb" and not quiet


def track(items: Sequence[Item], label: str) -> Iterator[Item]:
    """Iterate over `items`, showing how far along the work is."""
    shown = bar(items, f"{label:<24}") if shows_bars() else _lines(items, label)
    return reported(shown, label, len(items))


def reported(items: Iterable[Item], label: str, total: int, done: int = 0) -> Iterator[Item]:
    """Yield `items`; in a job of `gspure audit`, report how many of `total` are done, `done` of them before."""
    began = last = time.monotonic()
    has_reported = False
    for count, item in enumerate(items, start=done + 1):
        yield item
        now = time.monotonic()
        if now - last > _SECONDS_BETWEEN_EVENTS or (has_reported and count == total):
            _report(label, count / total, (now - began) / (count - done) * (total - count))
            last = now
            has_reported = True


def _report(part: str, share: float, left: float) -> None:
    """Write an event of this job to the pipe: the share of a part of its work that is done, and the seconds left."""
    if os.environ.keys() >= {EVENTS, JOB}:
        event = {"event": "part", "log": os.environ[JOB], "part": part, "share": share, "left": left}
        with suppress(OSError):  # nobody reads, or the pipe is full
            pipe = os.open(os.environ[EVENTS], os.O_WRONLY | os.O_NONBLOCK)
            try:
                os.write(pipe, f"{json.dumps(event)}\n".encode())  # whole, as it is short
            finally:
                os.close(pipe)


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
