"""Failed jobs of the workflow: a small JSON file beside the log of each says why it failed and what is missing.

The status of ``attack.log`` is ``attack.failed.json``.
"""

import re
import signal
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from gspure.artifacts import read_json, write_json
from gspure.errors import InputError

SUFFIX: Final = ".failed.json"

INTERRUPTIONS: Final = frozenset({signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
"""Signals that stop a run on purpose: what they end has not failed."""

_EXIT: Final = re.compile(r"exit status (\d{1,3})", re.ASCII)
_SIGNALED: Final = 128  # what a shell adds to the number of the signal that ended a command


@dataclass(frozen=True)
class Failure:
    """A failed job: its rule, the reason in one line, its log, and Snakemake's own log of the run.

    `missing` are the results that do not exist because of it: its own, and those of all jobs that need them.
    """

    rule: str
    reason: str
    log: str
    run: str
    missing: Sequence[str]

    def write(self) -> None:
        """Write its status."""
        write_json(status_of(self.log), asdict(self))


def status_of(log: str | Path) -> Path:
    """Return where the failure of the job with this log is recorded."""
    return Path(log).with_suffix(SUFFIX)


def read_failure(path: Path) -> Failure:
    """Read a status, or raise `InputError` if the file holds anything else."""
    match record := read_json(path):
        case {"rule": str(), "reason": str(), "log": str(), "run": str(), "missing": [*missing]} if len(record) == len(
            Failure.__dataclass_fields__
        ) and all(isinstance(file, str) for file in missing):
            return Failure(**record)
    raise InputError(path, "file", expected="the status of a failed job", found="other JSON")


def failures_below(folder: Path) -> list[Failure]:
    """Return all failures that are recorded below a folder, sorted by path."""
    return [read_failure(path) for path in sorted(folder.rglob(f"*{SUFFIX}"))]


def reason_in(log: Path, rule: str) -> str:
    """Return why a job failed, in one line, from its log: an error message, and `exit status N` as the last line."""
    lines, status = _ending(log)
    if status is None:
        return f"{rule}: stopped without an exit status, possibly out of memory or time"
    if status > _SIGNALED:
        hint = ", possibly out of memory" if status == _SIGNALED + signal.SIGKILL else ""
        return f"{rule}: ended by {_signal_name(status - _SIGNALED)}{hint}"
    last = lines[-1] if lines else f"exit status {status}"
    return last if last.startswith("gspure ") else f"{rule}: {last}"


def is_interrupted(log: Path, *, stopped: bool) -> bool:
    """Return whether the job with this log was interrupted: a shell that ends with a `stopped` run writes no status."""
    status = _ending(log)[1]
    return stopped if status is None else status - _SIGNALED in INTERRUPTIONS


def _ending(log: Path) -> tuple[list[str], int | None]:
    """Return the lines of a log, and the exit status in its last line; None if there is none."""
    text = log.read_text(encoding="utf-8", errors="replace") if log.is_file() else ""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if not lines or not (ended := _EXIT.fullmatch(lines[-1])):
        return lines, None
    return lines[:-1], int(ended[1])


def summary(failures: Iterable[Failure]) -> list[str]:
    """Return a line for each reason, with the log of the first job that failed for it."""
    by_reason: dict[str, list[Failure]] = {}
    for failure in failures:
        by_reason.setdefault(failure.reason, []).append(failure)
    return [f"{reason} ({_logs(alike)})" for reason, alike in by_reason.items()]


def unfinished(failures: Iterable[Failure]) -> dict[str, list[str]]:
    """Return the variants and controls without metrics because of failures, by model."""
    folders = {Path(path).parent for failure in failures for path in failure.missing if path.endswith("/metrics.csv")}
    by_model: dict[str, list[str]] = {}
    for folder in sorted(folders):
        by_model.setdefault("/".join(folder.parts[-3:-1]), []).append(folder.name)
    return by_model


def _logs(failures: Sequence[Failure]) -> str:
    more = f" and {len(failures) - 1} more" if len(failures) > 1 else ""
    return f"{failures[0].log}{more}"


def _signal_name(number: int) -> str:
    return signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
