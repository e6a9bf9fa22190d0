"""A logger of Snakemake, which finds it by its name: events as lines of JSON, for `gspure.workflow.running`."""

import json
import os
import select
import signal
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field
from logging import ERROR, LogRecord
from pathlib import Path
from typing import Any, Final

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent
from snakemake_interface_logger_plugins.settings import LogHandlerSettingsBase

_LONGEST: Final = 300  # characters of a text: the pipe takes a line of up to 4096 bytes as a whole
_UNCOUNTED: Final = ("all", "total")  # the rule that makes nothing itself, and the sum
_GRACE: Final = 0.5  # seconds in which jobs end the programs that they started


@dataclass
class LogHandlerSettings(LogHandlerSettingsBase):
    """Options that Snakemake gets with this logger."""

    silent: bool = field(default=False, metadata={"help": "Leave the console to whoever reads the events"})


class LogHandler(LogHandlerBase):
    """Write events to the pipe `$GSPURE_EVENTS`; if its reader dies, end Snakemake and its jobs."""

    writes_to_file = False
    has_filter = True  # without one, Snakemake's --quiet would hide events
    has_formatter = True
    needs_rulegraph = False

    def __post_init__(self) -> None:
        self._path = Path(os.environ["GSPURE_EVENTS"])  # alone in a temporary folder
        self._pipe = os.open(self._path, os.O_WRONLY)
        threading.Thread(target=self._watch, daemon=True).start()

    @property
    def writes_to_stream(self) -> bool:
        """Whether this logger replaces Snakemake's lines on the console."""
        return bool(getattr(self.settings, "silent", False))

    def emit(self, record: LogRecord) -> None:
        """Write the event of a record, if it has one."""
        if event := _event(record):
            os.write(self._pipe, f"{json.dumps(event)}\n".encode())

    def _watch(self) -> None:
        """Wait until nobody reads the pipe, then remove it, and end the process group, which is Snakemake's own."""
        poll = select.poll()
        poll.register(self._pipe, 0)  # errors only
        poll.poll()
        with suppress(OSError):
            self._path.unlink()
            self._path.parent.rmdir()
        os.killpg(0, signal.SIGINT)
        time.sleep(_GRACE)
        os.killpg(0, signal.SIGKILL)


def _event(record: LogRecord) -> dict[str, Any] | None:
    fields = record.__dict__
    match fields.get("event"):
        case LogEvent.RUN_INFO:
            jobs = {rule: count for rule, count in fields["stats"].items() if rule not in _UNCOUNTED}
            return {"event": "planned", "jobs": jobs}
        case LogEvent.JOB_INFO:
            text = fields["rule_msg"] or fields["rule_name"]
            return {
                "event": "started",
                "job": fields["jobid"],
                "text": text[:_LONGEST],
                "log": next(iter(fields["log"]), ""),
            }
        case LogEvent.JOB_FINISHED:
            return {"event": "finished", "job": fields["job_id"]}
        case LogEvent.JOB_ERROR:
            return {"event": "failed", "job": fields["jobid"]}
        case _ if record.levelno >= ERROR:
            return {"event": "error", "text": _in_one_line(record.getMessage())}
    return None


def _in_one_line(message: str) -> str:
    """Return Snakemake's reason; of a traceback, its last line."""
    lines = [line.strip() for line in message.strip().splitlines()]
    is_traceback = message.startswith("Traceback")
    return (lines[-1] if is_traceback else " ".join(lines))[:_LONGEST]
