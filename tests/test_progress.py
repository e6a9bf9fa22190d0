"""Progress on a terminal."""

import io
import sys
from collections.abc import Callable, Iterable

import pytest

from gspure.progress import track
from gspure.training.trainer import watched


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown(monkeypatch: pytest.MonkeyPatch, run: Callable[[], Iterable[object]]) -> str:
    """Return what a wide terminal shows of a run."""
    terminal = Terminal()
    with monkeypatch.context() as patched:
        patched.setattr(sys, "stderr", terminal)
        patched.setenv("COLUMNS", "200")
        list(run())
    return terminal.getvalue()


MARKUP = "price [bold]5[/bold] [/]"
"""Rich would take the first tag for a command, and refuse the last one."""


def test_a_label_is_text_not_markup(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MARKUP in shown(monkeypatch, lambda: track([1, 2], MARKUP))


def test_the_state_of_a_run_is_text_not_markup(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MARKUP in shown(monkeypatch, lambda: watched([0.5], 1, lambda: MARKUP))
