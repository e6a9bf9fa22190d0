"""Jobs that fail without stopping others: a note beside what they should have made says why.

The note of ``kept.npy`` is ``kept.npy.failed``. It outlives the failure, since it counts them: a workflow that looks at
the count sees that the file is to be tried again.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final, NamedTuple

from gspure.artifacts import read_json, write_json, write_text
from gspure.errors import InputError

SUFFIX: Final = ".failed"


class Note(NamedTuple):
    """What is known of the attempts to make a file or folder."""

    failures: int = 0
    """How often it failed by itself, not for want of another file."""

    reason: str = ""
    """Why it could not be made; empty once it is there."""


def note_of(path: str | Path) -> Note:
    """Return the note beside a file or folder, or raise `InputError` if it is damaged."""
    file = _beside(Path(path))
    if not file.exists():
        return Note()
    match read_json(file):
        case {"failures": int(failures), "reason": str(reason)}:
            return Note(failures, reason)
    raise InputError(file, "file", expected="a note of failures", found="other JSON")


def failed_below(path: Path) -> list[Path]:
    """Return what could not be made: `path` itself, or what is below it, in sorted order."""
    path = path.resolve()
    made = [path, *(note.with_name(note.name.removesuffix(SUFFIX)) for note in sorted(path.rglob(f"*{SUFFIX}")))]
    return [file for file in made if note_of(file).reason]


def made(paths: Iterable[Path]) -> list[Path]:
    """Return the files that did not fail, nor the folder in which they lie."""
    return [path for path in paths if not (note_of(path).reason or note_of(path.parent).reason)]


def mark_failed(paths: Iterable[Path], reason: str, *, own: bool) -> None:
    """Note why files or folders could not be made; where a file should be, a text says so.

    What has no suffix is a folder.

    Parameters
    ----------
    paths : iterable of Path
    reason : str
    own : bool
        Whether making them failed, rather than that something they are made of failed.

    """
    for path in paths:
        if not path.suffix:
            path.mkdir(parents=True, exist_ok=True)
        else:
            write_text(path, f"This could not be made: {reason}\n")
        write_json(_beside(path), {"failures": note_of(path).failures + own, "reason": reason})


def mark_made(paths: Iterable[Path]) -> None:
    """Note that what failed before is there."""
    for path in paths:
        if (note := note_of(path)).reason:
            write_json(_beside(path), {"failures": note.failures, "reason": ""})


def _beside(path: Path) -> Path:
    return path.with_name(path.name + SUFFIX)
