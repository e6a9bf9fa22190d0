"""The checks of a detector: its command reads a few renders, or the file of their model, twice."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from gspure.certificate.check import Check, check, name_check, require
from gspure.errors import InputError
from gspure.metrics.readings import Reading, answers, reading_of

TIMEOUT: Final = 600.0  # seconds


def detector_checks(name: str, command: str, renders: Path, model: Path) -> Iterator[Check]:
    """Yield the checks of a detector, which gets a folder of renders or, if it cannot read these, a model's file."""
    read: list[tuple[Path, list[Reading]]] = []
    yield name_check(name)
    yield check("reads renders, or the model's file", lambda: read.append(_read(command, renders, model)))
    if not read:
        return
    ((source, readings),) = read
    yield check("gives the same answer again", lambda: _repeats(command, source, readings))


def _read(command: str, renders: Path, model: Path) -> tuple[Path, list[Reading]]:
    """Return what a detector reads, and from what."""
    refusals = []
    for source in (renders, model):
        try:
            return source, _readings(command, source)
        except InputError as refusal:
            refusals.append(refusal)
    raise refusals[0]


def _readings(command: str, source: Path) -> list[Reading]:
    """Return what a detector reads; the first bits stand for the message, which only its owner knows."""
    answer = answers(command, source, TIMEOUT)
    first = next(iter(answer.values()))
    message = first if isinstance(first, str) else ""
    return [reading_of(view, value, message) for view, value in answer.items()]


def _repeats(command: str, source: Path, readings: list[Reading]) -> None:
    again = _readings(command, source)
    changed = [one.view for one, other in zip(readings, again, strict=True) if one != other]
    require(not changed, f"{', '.join(changed)} differ")
