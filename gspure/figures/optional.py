"""Figures that may fail without losing the results that they illustrate."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gspure.progress import warn


@contextmanager
def optional(path: Path) -> Iterator[None]:
    """Draw the figure `path` in the block; on failure, warn and delete an older figure."""
    try:
        yield
    except Exception as error:  # noqa: BLE001 - plotting libraries raise many types
        path.unlink(missing_ok=True)
        reason = " ".join(str(error).split()) or type(error).__name__
        warn(f"{path}: not drawn: {reason}")
