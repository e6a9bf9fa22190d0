"""What people see of a run: one live line on a terminal, else plain lines."""

import io
import json
import sys

import pytest

from gspure import progress
from gspure.progress import say
from gspure.workflow.console import Console


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def now(monkeypatch):
    """The time, as a list of one number."""
    time = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: time[0])
    return time


def send(shown: Console, *events: dict[str, object]) -> None:
    for event in events:
        shown.read_event(json.dumps(event))
    shown.refresh()


def part(share: float, left: float) -> dict[str, object]:
    return {"event": "part", "log": "a.log", "part": "train", "share": share, "left": left}


PLANNED = {"event": "planned", "jobs": {"embed": 4, "draw": 5}}
STARTED = {"event": "started", "job": 4, "text": "Embedding", "log": "a.log"}
LATER = {"event": "started", "job": 5, "text": "Drawing vanilla/bot", "log": "b.log"}
WHOLE = {"event": "started", "job": 6, "text": "All", "log": ""}
FAILED = {"event": "failed", "job": 4}


def test_a_terminal_has_one_live_line(now, monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "_shown", "")
    shown = Console()
    send(shown)
    send(shown, PLANNED, STARTED, LATER)
    send(shown, part(0.41, 48.2))
    now[0] = 40.0
    shown.refresh()
    say("a warning")
    send(shown, part(1.0, 0.0))
    send(shown, {"event": "finished", "job": 4})
    send(shown, {"event": "finished", "job": 5}, WHOLE, {"event": "finished", "job": 6})
    shown.end(0)
    assert terminal.getvalue().split("\r\x1b[2K") == [
        "planning: 0:00 so far",
        "[0/9] Embedding",
        "[0/9] Embedding: train 41%, 0:48 left",
        "[0/9] Embedding: train 41%, 0:08 left",
        "a warning\n[0/9] Embedding: 0:40 so far",
        "[1/9] Drawing bot: 0:40 so far",
        "[2/9] Drawing bot: 0:40 so far",
        "2 jobs done in 0:40\n",
    ]


def test_without_a_terminal_there_is_a_line_per_job_and_no_long_silence(now, capsys):
    shown = Console()
    send(shown, PLANNED, STARTED)
    for second in range(30):
        now[0] = float(second)
        send(shown, part(second / 30, 30.0 - second))
    assert capsys.readouterr().err.splitlines() == [
        "[0/9] Embedding",
        "[0/9] Embedding: train 30%, 0:21 left",
        "[0/9] Embedding: train 60%, 0:12 left",
        "[0/9] Embedding: train 90%, 0:03 left",
    ]


def test_quiet_prints_reasons_only(now, monkeypatch, capsys):
    monkeypatch.setattr(progress, "quiet", True)
    shown = Console()
    send(shown, PLANNED, STARTED)
    now[0] = 99.0
    send(shown, FAILED)
    shown.end(1)
    assert capsys.readouterr().err == "Embedding failed: see a.log\n"


@pytest.mark.parametrize(
    ("events", "output", "status", "last"),
    [
        ([PLANNED], [], 0, "0 jobs done in 0:00\n"),
        ([], [], 0, "nothing to do: all results are up to date\n"),
        ([], ["Building DAG", "", "no rule to make it", " "], 1, "gspure: no rule to make it\n"),
        ([PLANNED, STARTED, FAILED], [], 1, ""),
        ([PLANNED, STARTED], ["gspure: mine.yaml: no"], 1, ""),
        ([], ["warning: doubtful", "no rule to make it"], 1, "gspure: no rule to make it\n"),
    ],
    ids=["done", "up to date", "reason", "reason of a job", "reason of a program", "warning"],
)
def test_the_end_of_a_run_counts_its_jobs_or_gives_a_reason_if_none_was_printed(capsys, events, output, status, last):
    shown = Console()
    send(shown, *events)
    capsys.readouterr()
    for line in output:
        shown.read_output(line)
    assert capsys.readouterr().err.splitlines() == [line for line in output if line.startswith(("gspure", "warning"))]
    shown.end(status)
    assert capsys.readouterr().err == last


def test_a_warning_of_a_job_is_printed_when_it_ends(tmp_path, capsys):
    log = tmp_path / "a.log"
    log.write_text("device 0\nwarning: are these its cameras?\n")
    shown = Console()
    send(shown, PLANNED, STARTED | {"log": str(log)}, {"event": "finished", "job": 4})
    assert "warning: are these its cameras?\n" in capsys.readouterr().err
