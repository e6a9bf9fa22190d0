"""What people see of a run of the workflow: jobs that start, how far they are, and the reasons of failures."""

import json
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from shutil import disk_usage
from typing import Any, Final

from gspure.errors import printable
from gspure.progress import say, show, shows_bars, tell, warn
from gspure.text import percent

_SILENCE: Final = 8.0  # seconds, the longest without a line where there is no terminal
_LITTLE: Final = 2**20  # bytes of free space on a disk that is full
_WARNING: Final = "warning: "
_OWN_MODEL: Final = " vanilla/"  # before the name of a model of the user's, which needs no other
_OURS: Final = "gspure"  # how our programs begin the lines that say why they fail


@dataclass
class Job:
    """A job that runs. It may report one part of its work after the other, such as training."""

    text: str
    log: str
    began: float
    part: str = ""
    share: float = 1.0  # of the part that is done; 1 between two parts
    end: float = 0.0  # of the part, at its speed so far

    def line(self, now: float) -> str:
        """Return what the job does, with the time left of its part or, between parts, the time of the job so far."""
        if self.share < 1:
            return f"{self.text}: {self.part} {percent(self.share, 0)}, {clock(self.end - now)} left"
        seconds = now - self.began
        return f"{self.text}: {clock(seconds)} so far" if seconds >= 1 else self.text

    def lines(self) -> list[str]:
        """Return the lines of the job's log, as far as it can be read."""
        with suppress(OSError):
            return Path(self.log).read_text(encoding="utf-8", errors="replace").split("\n")
        return []

    def failure(self) -> str:
        """Return why the job failed, by the last line of its log."""
        reason = next((line for line in reversed(self.lines()) if line.strip()), "")
        return f"{self.text} failed: {reason or _disk_fault() or f'see {self.log}'}"


class Console:
    """A run on standard error: one live line on a terminal, else a line for each job and one whenever it is silent.

    `read_event` takes the events of Snakemake and of jobs, `read_output` what Snakemake and our programs print beside
    them; `refresh` is called often, and `end` once.
    """

    def __init__(self) -> None:
        self._began = self._printed = time.monotonic()
        self._running: dict[int, Job] = {}  # in order of their start
        self._shown: Job | None = None  # the oldest one; between two jobs, the last one
        self._planned = 0
        self._done = 0
        self._reason = ""  # the last one of Snakemake
        self.reasons: list[str] = []  # of failures, as printed

    def read_event(self, line: str) -> None:
        """Take an event into account, and print the reason of a failure."""
        with suppress(ValueError):  # half a line, of a process that was killed
            self._apply(json.loads(line), time.monotonic())

    def _apply(self, event: Mapping[str, Any], now: float) -> None:
        match event:
            case {"event": "planned", "jobs": jobs}:
                self._planned = sum(jobs.values())
            case {"event": "started", "job": number, "text": text, "log": log} if log:  # without one, it does nothing
                self._running[number] = Job(printable(text).replace(_OWN_MODEL, " "), log, now)
                if not shows_bars():
                    self._say(self._running[number], now)
            case {"event": "finished", "job": number} if number in self._running:
                self._done += 1
                for text in self._running.pop(number).lines():
                    if text.startswith(_WARNING):
                        warn(printable(text.removeprefix(_WARNING)))
            case {"event": "failed", "job": number} if number in self._running:
                self._give(self._running.pop(number).failure())
            case {"event": "error", "text": text}:
                self._reason = text
            case {"event": "part", "log": log, "part": part, "share": share, "left": left}:
                for job in self._running.values():
                    if job.log == log:
                        job.part = printable(part)
                        job.share = share
                        job.end = now + left

    def read_output(self, line: str) -> None:
        """Print a line of our programs; one of Snakemake may become the reason of its end."""
        if line.startswith(_OURS):
            self._give(line)
        elif line.startswith(_WARNING):
            self._tell(line)
        elif line.strip():
            self._reason = line

    def refresh(self) -> None:
        """Draw the live line, or print one after a silence."""
        now = time.monotonic()
        self._shown = next(iter(self._running.values()), self._shown)
        if shows_bars():
            show(self._line(self._shown, now))
        elif now - self._printed > _SILENCE:
            self._say(self._shown, now)

    def end(self, status: int) -> None:
        """Say how the run ended: Snakemake's exit status, or minus the signal that killed it."""
        show("")
        if status < 0:
            self._give(f"gspure: Snakemake was killed by signal {-status}")
        elif status and not self.reasons:
            reason = _disk_fault() or self._reason or f"Snakemake ended with status {status}"
            self._give(f"gspure: {reason}")
        elif not status and self._planned:
            say(f"{self._done} jobs done in {clock(time.monotonic() - self._began)}")
        elif not status:
            say("nothing to do: all results are up to date")

    def _line(self, job: Job | None, now: float) -> str:
        place = f"[{self._done}/{self._planned}] " if self._planned else ""
        return f"{place}{job.line(now)}" if job else f"planning: {clock(now - self._began)} so far"

    def _say(self, job: Job | None, now: float) -> None:
        say(self._line(job, now))
        self._printed = now

    def _give(self, reason: str) -> None:
        self.reasons.append(printable(reason))
        self._tell(reason)

    def _tell(self, line: str) -> None:
        tell(printable(line))
        self._printed = time.monotonic()


class Listener(Console):
    """The console of a program that asked for no output: it keeps the `reasons`."""

    def _tell(self, line: str) -> None:
        """Print nothing."""


def _disk_fault() -> str:
    """Return that the disk of the results is full, if it is: then logs are empty, and reasons of little use."""
    return f"no space left on the disk of {Path.cwd()}" if disk_usage(".").free < _LITTLE else ""


def clock(seconds: float) -> str:
    """Return a duration as a clock shows it: 0:48, 12:05, 1:00:00."""
    minutes, rest = divmod(max(0, round(seconds)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
