"""What a dry run of the workflow tells: the jobs that would run, by what they do, and how long such jobs took here."""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from statistics import median
from typing import Any, Final

from gspure.grouping import grouped
from gspure.workflow.console import Console

_RECORDS: Final = Path(".snakemake", "metadata")  # one file of JSON per output of a job


class Forecast(Console):
    """The console of a dry run: `jobs` are the numbers of jobs by rule; a reason of failure is printed."""

    def __init__(self) -> None:
        super().__init__()
        self.jobs: dict[str, int] = {}

    def _apply(self, event: Mapping[str, Any], now: float) -> None:
        match event:
            case {"event": "planned", "jobs": jobs}:
                self.jobs = jobs
            case {"event": "error"}:
                super()._apply(event, now)

    def refresh(self) -> None:
        """Show nothing: a dry run takes seconds."""

    def end(self, status: int) -> None:
        """Print the reason of a failure."""
        if status:
            super().end(status)


def forecast_lines(jobs: Mapping[str, int], total: int) -> Iterator[str]:
    """Yield a sentence on jobs by rule, of `total` in the workflow, and a line for each rule."""
    count = sum(jobs.values())
    seconds = _seconds_by_rule()
    duration = ""
    if jobs.keys() <= seconds.keys():
        minutes = round(sum(seconds[rule] * number for rule, number in jobs.items()) / 60)
        duration = f", about {minutes} min" if minutes else ", less than a minute"
    yield f"{count} jobs to run{duration}; {total - count} up to date" if count else "nothing to do: all is up to date"
    for rule, number in jobs.items():
        yield f"{number:>6}  {rule.replace('_', ' ')}"


def _seconds_by_rule() -> dict[str, float]:
    """Return how long a job of each rule took in this folder; the device serves one after the other."""
    records = []
    for file in _RECORDS.rglob("*"):
        with suppress(OSError, ValueError, KeyError, TypeError):  # a folder, or a record of another version
            record = json.loads(file.read_text(encoding="utf-8"))
            records.append((str(record["rule"]), float(record["endtime"]) - float(record["starttime"])))
    by_rule = grouped(records, lambda record: record[0])
    return {rule: median(seconds for _, seconds in measured) for rule, measured in by_rule.items()}
