"""Snakemake as a child of ``gspure audit``, and each way in which it ends. A program takes the place of Snakemake."""

import fcntl
import json
import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from snakemake_interface_logger_plugins.common import LogEvent

from gspure.errors import InputError
from gspure.progress import EVENTS
from gspure.workflow import running
from gspure.workflow.console import Console
from gspure.workflow.plugins.snakemake_logger_plugin_gspure import LogHandler, LogHandlerSettings

WITH_JOB = """
signal.signal(signal.SIGINT, signal.SIG_IGN)
job = subprocess.Popen([sys.executable, "-c", "import signal, time; signal.signal(2, signal.SIG_IGN); time.sleep(60)"])
pathlib.Path("job").write_text(str(job.pid))
time.sleep(60)
"""
"""A Snakemake and a job that do not end when they are interrupted."""


def test_jobs_and_reasons_take_the_place_of_snakemake_s_lines(snakemake, capfd):
    Path("b.log").write_text("work\ngspure evaluate: no such file\n\n")
    snakemake("""
send(event="planned", jobs={"attack": 4})
send(event="started", job=1, text="Attacking", log="a.log")
send(event="finished", job=1)
send(event="started", job=2, text="Evaluating", log="b.log")
print("Building DAG of jobs", file=sys.stderr)
print("gspure: a warning of ours", file=sys.stderr)
print("a result")
send(event="failed", job=2)
send(event="error", text="At least one job did not complete")
sys.exit(1)
""")
    assert not running.run(["--cores", "1"], Console())
    output, lines = capfd.readouterr()
    assert output == ""
    assert {*lines.splitlines()} == {
        "[0/4] Attacking",
        "[1/4] Evaluating",
        "gspure: a warning of ours",
        "Evaluating failed: gspure evaluate: no such file",
    }


def test_without_silence_output_is_snakemake_s_which_gets_no_settings_of_the_user(snakemake, monkeypatch, capfd):
    monkeypatch.setenv("SNAKEMAKE_PROFILE", "slurm")
    monkeypatch.setenv("SNAKEMAKE_CONDA_PREFIX", "conda")
    snakemake("""
for number in range(10_000):  # more than a pipe holds, which somebody must read
    send(event="started", job=number, text="Attacking", log="a.log")
print(*sys.argv[1:], *(name for name in os.environ if name.startswith("SNAKEMAKE")))
print("Building DAG of jobs", file=sys.stderr)
""")
    assert running.run(["--cores", "1"])
    assert capfd.readouterr() == ("--logger gspure --cores 1\n", "Building DAG of jobs\n")


def test_a_dry_run_counts_the_jobs_and_knows_how_long_such_jobs_took_here(snakemake):
    records = [{"rule": "draw", "starttime": 0, "endtime": 60}, {"rule": "evaluate_all", "starttime": 5, "endtime": 35}]
    snakemake("""
jobs = {"draw": 1, "evaluate_all": 2} | ({"train": 3} if "--forceall" in sys.argv else {})
assert "--dry-run" in sys.argv
send(event="planned", jobs=jobs)
send(event="started", job=1, text="Drawing", log="a.log")
""")
    counts = ["     1  draw", "     2  evaluate all"]
    assert running.forecast([]) == ["3 jobs to run; 3 up to date", *counts]
    folder = Path(".snakemake", "metadata", "nested")
    folder.mkdir(parents=True)
    (folder / "other").write_text('{"rule": "train"}')
    for number, record in enumerate(records):
        (folder / str(number)).write_text(json.dumps(record))
    assert running.forecast([]) == ["3 jobs to run, about 2 min; 3 up to date", *counts]
    snakemake("print('gspure: mine.yaml: no such setting', file=sys.stderr); sys.exit(2)")
    assert running.forecast([]) == []


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        ('send(event="error", text="WildcardError: no wildcard {x}"); sys.exit(1)', "WildcardError: no wildcard {x}"),
        ('raise OSError(28, "No space left on device")', "OSError: [Errno 28] No space left on device"),
        ("print('gspure: mine.yaml: no such setting', file=sys.stderr); sys.exit(2)", "mine.yaml: no such setting"),
        ("os.kill(os.getpid(), signal.SIGKILL)", "Snakemake was killed by signal 9"),
        ("sys.exit(7)", "Snakemake ended with status 7"),
    ],
)
def test_the_reason_of_a_failure_is_one_line(snakemake, capfd, end, reason):
    snakemake(end)
    assert not running.run([], Console())
    assert capfd.readouterr().err == f"gspure: {reason}\n"


DEMO = """
import sys
from gspure.__main__ import main
from gspure.workflow import running
running._GRACE = {grace}
sys.argv[1:] = ["demo", "--quiet"]
sys.exit(main())
"""


def started(ignored: tuple[int, ...] = (), grace: float = 0.2) -> tuple[subprocess.Popen[str], int]:
    """`gspure demo`, when a job runs, and that job; the process ignores some signals from its beginning."""

    def ignore() -> None:
        for number in ignored:
            signal.signal(number, signal.SIG_IGN)

    command = [sys.executable, "-c", DEMO.format(grace=grace)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=ignore)  # noqa: PLW1509
    assert comes(lambda: Path("job").is_file() and Path("job").read_text() != "")
    return process, int(Path("job").read_text())


def comes(condition: Callable[[], bool]) -> bool:
    """Wait for a condition, and return whether it came."""
    deadline = time.monotonic() + 30
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    return condition()


def has_ended(process: int) -> bool:
    """Return whether a process has ended, even if it waits for its parent."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


@pytest.mark.parametrize(
    ("numbers", "ignored", "grace", "status"),
    [
        ((signal.SIGINT,), (signal.SIGINT,), 0.2, 130),  # as in the background of a script
        ((signal.SIGHUP,), (), 0.2, 129),
        ((signal.SIGHUP, signal.SIGTERM), (signal.SIGHUP,), 0.2, 143),  # by `nohup`, it goes on without its terminal
        ((signal.SIGINT, signal.SIGINT), (), 60, 130),  # the second one kills at once
    ],
)
def test_a_signal_ends_the_run_with_its_jobs_and_one_line(snakemake, numbers, ignored, grace, status):
    snakemake(WITH_JOB)
    process, job = started(ignored, grace)
    for number in numbers:
        process.send_signal(number)
        time.sleep(0.3)
    _, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (status, "gspure demo: interrupted\n")
    assert comes(lambda: has_ended(job))


def test_jobs_end_when_audit_is_killed(snakemake):
    snakemake(f"""
from snakemake_logger_plugin_gspure import LogHandler, LogHandlerSettings
LogHandler(None, LogHandlerSettings(silent=True))
os.close(pipe)
{WITH_JOB}""")
    process, job = started()
    process.kill()
    process.communicate(timeout=20)
    assert comes(lambda: has_ended(job))
    assert not [*Path("temporary").iterdir()]


def test_a_lock_is_removed_unless_a_run_holds_it(snakemake, monkeypatch):
    assert not running.unlock([])
    snakemake('pathlib.Path("arguments").write_text(" ".join(sys.argv))')
    Path(".snakemake/locks").mkdir(parents=True)
    Path(".snakemake/locks/0.input.lock").touch()
    monkeypatch.setattr(running, "_ENDING", 0.1)
    monkeypatch.setenv(EVENTS, os.devnull)  # for the program
    with Path(".snakemake/gspure.lock").open("w") as alive:
        fcntl.flock(alive, fcntl.LOCK_SH)
        with pytest.raises(InputError, match="no other run here"):
            running.unlock([])
    assert running.unlock(["--cores", "1"])
    assert Path("arguments").read_text().endswith("--cores 1 --unlock")


def test_the_logger_writes_events_as_lines(tmp_path, monkeypatch):
    pipe = tmp_path / "events"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    monkeypatch.setenv(EVENTS, str(pipe))
    monkeypatch.setattr(LogHandler, "_watch", lambda _: None)  # it would end the tests with their reader
    handler = LogHandler(None, LogHandlerSettings(silent=True))
    records = [
        {"event": LogEvent.RUN_INFO, "stats": {"all": 1, "draw": 2, "total": 3}},
        {"event": LogEvent.JOB_INFO, "jobid": 2, "rule_msg": "Ättacking", "rule_name": "attack", "log": ["a.log"]},
        {"event": LogEvent.JOB_INFO, "jobid": 3, "rule_msg": None, "rule_name": "all", "log": []},
        {"event": LogEvent.PROGRESS, "done": 1, "total": 3},
        {"event": LogEvent.JOB_FINISHED, "job_id": 3},
        {"event": LogEvent.JOB_ERROR, "jobid": 2},
        {"event": LogEvent.ERROR, "msg": "WorkflowError:\n  no wildcard"},
        {"msg": "Traceback (most recent call last):\n  File x\nOSError: disk full"},
    ]
    for fields in records:
        level = logging.INFO if "jobid" in fields or "total" in fields else logging.ERROR
        handler.emit(logging.makeLogRecord({"levelno": level, **fields}))
    assert handler.writes_to_stream
    assert [json.loads(line) for line in os.read(reader, 9999).splitlines()] == [
        {"event": "planned", "jobs": {"draw": 2}},
        {"event": "started", "job": 2, "text": "Ättacking", "log": "a.log"},
        {"event": "started", "job": 3, "text": "all", "log": ""},
        {"event": "finished", "job": 3},
        {"event": "failed", "job": 2},
        {"event": "error", "text": "WorkflowError: no wildcard"},
        {"event": "error", "text": "OSError: disk full"},
    ]
