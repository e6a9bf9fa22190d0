"""Figures that may fail: what they illustrate has been computed, and stays."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gspure.progress import say


@contextmanager
def optional(path: Path) -> Iterator[None]:
    """Draw the figure `path` in the block; if that fails, warn, and leave no older figure in its place."""
    try:
        yield
    except Exception as error:  # noqa: BLE001 - whatever a plotting library raises
        path.unlink(missing_ok=True)
        reason = " ".join(str(error).split()) or type(error).__name__
        say(f"warning: {path}: not drawn: {reason}")
