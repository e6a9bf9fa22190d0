"""The jobs of a run on the screen: a bar on a terminal, else a line per job, in place of Snakemake's lines."""

from __future__ import annotations

import logging
import re
import sys
import time
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from gspure.progress import say, shows_bars

if TYPE_CHECKING:
    from rich.progress import Progress

SHOWN: Final = "GSPURE_SHOWN"
"""Environment variable of `gspure audit`: what to show, `jobs` or `problems`; Snakemake's lines if it is unset."""

COMMAND: Final = "GSPURE_COMMAND"  # environment variable: the command line of `gspure audit`, to try again

_WARNING: Final = re.compile(r"^warning: (?:\S*/\S*: )?(.+)$", re.MULTILINE)  # a path at its start, and the rest
_PROGRESS: Final = re.compile(r"^.*: \d+ of \d+$", re.MULTILINE)
_TOLD_BY_FAILURES: Final = ("Exiting because a job execution failed", "WorkflowError:\nAt least one job did not")
_ALWAYS: Final = ("Nothing to be done", "Terminating processes")


class Job(NamedTuple):
    """A running job."""

    message: str
    logs: Sequence[str]

    def __str__(self) -> str:
        """Return the last line of progress in the job's logs, if there is one, and what it does."""
        lines = _PROGRESS.findall(self.logged())
        return f"{lines[-1]} ({self.message})" if lines else self.message

    def logged(self) -> str:
        """Return the text of its logs."""
        return "\n".join(path.read_text(errors="replace") for path in map(Path, self.logs) if path.is_file())


class JobProgress(logging.Handler):
    """Shows number and meaning of jobs, failures and warnings of jobs, and those of Snakemake's logger.

    The same warning by several jobs, also of several files, is shown once.
    """

    def __init__(self) -> None:
        super().__init__()
        self._running: dict[int, Job] = {}
        self._warned: set[str] = set()
        self._started = self._done = self._total = 0
        self._began = time.monotonic()
        self._bar: Progress | None = None

    def emit(self, record: logging.LogRecord) -> None:
        """Show what a record of Snakemake's logger reports."""
        fields = vars(record)
        match fields.get("event"):
            case "run_info":
                self._total = fields["stats"]["total"]
                self._bar = _started_bar(self._total) if shows_bars() else None
            case "job_info":
                self._started += 1
                self._running[fields["jobid"]] = Job(fields["rule_msg"] or fields["rule_name"], fields["log"])
                self._show_newest()
            case "job_finished":
                self._warn_of(self._running.pop(fields["job_id"], Job("", ())))
            case "progress":
                self._done, self._total = fields["done"], fields["total"]
                self._show_newest(line=False)
            case "job_error":
                job = self._running.pop(fields["jobid"], Job(fields["rule_name"], ()))
                self._print(f"failed: {job.message} ({', '.join(fields['log'])})")
            case None | "error":
                text = record.getMessage()
                if text.startswith(_ALWAYS) or (
                    record.levelno >= logging.WARNING and not text.startswith(_TOLD_BY_FAILURES)
                ):
                    self._print(text)

    def close(self) -> None:
        """Leave the bar as it is."""
        if self._bar:
            self._bar.stop()
            self._bar = None
        super().close()

    def _show_newest(self, *, line: bool = True) -> None:
        newest = next(reversed(self._running.values()), None)
        if self._bar:
            (task,) = self._bar.tasks
            self._bar.update(task.id, completed=self._done, total=self._total, job=newest or task.fields["job"])
        elif line and newest:
            elapsed = timedelta(seconds=round(time.monotonic() - self._began))
            say(f"job {self._started} of {self._total}, {elapsed}: {newest.message}")

    def _warn_of(self, job: Job) -> None:
        for warning in _WARNING.finditer(job.logged()):
            if warning[1] not in self._warned:
                self._warned.add(warning[1])
                self._print(warning[0])

    def _print(self, text: str) -> None:
        if self._bar:
            self._bar.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            print(text, file=sys.stderr, flush=True)  # noqa: T201


def _started_bar(total: int) -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.table import Column

    job = TextColumn("{task.fields[job]}", markup=False, table_column=Column(no_wrap=True, overflow="ellipsis"))
    bar = Progress(
        BarColumn(24),
        MofNCompleteColumn(),
        TextColumn("jobs"),
        TimeElapsedColumn(),
        job,
        console=Console(stderr=True),
        refresh_per_second=2,
    )
    bar.add_task("", total=total, job="")
    bar.start()
    return bar
