"""What `gspure audit` shows of Snakemake's log records."""

import io
import logging
import sys

import pytest

from gspure import progress
from gspure.workflow.job_progress import JobProgress


class Terminal(io.StringIO):
    def isatty(self):
        return True


RUN = [
    (logging.INFO, "Building DAG of jobs...", {}),
    (logging.INFO, "Job stats", {"event": "run_info", "stats": {"attack_model": 3, "total": 3}}),
    (
        logging.INFO,
        "",
        {"event": "job_info", "jobid": 4, "rule_msg": "Attacking a: crop", "rule_name": "attack_model", "log": []},
    ),
    (logging.INFO, "", {"event": "job_finished", "job_id": 4}),
    (logging.INFO, "", {"event": "progress", "done": 1, "total": 3}),
    (logging.WARNING, "Low on [bold]disk", {}),
    (
        logging.INFO,
        "",
        {"event": "job_info", "jobid": 2, "rule_msg": "Rendering a", "rule_name": "render_scene", "log": []},
    ),
    (logging.ERROR, "", {"event": "job_error", "jobid": 2, "log": ["results/logs/a.log"], "rule_name": "render_scene"}),
    (logging.ERROR, "Exiting because a job execution failed. Look above", {}),
    (logging.ERROR, "MissingInputException: a.ply", {"event": "error"}),
]
PROBLEMS = ["Low on [bold]disk", "failed: Rendering a (results/logs/a.log)", "MissingInputException: a.ply"]


def shown(monkeypatch, stream, *, quiet=False, records=RUN):
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(progress, "quiet", quiet)
    monkeypatch.setenv("COLUMNS", "200")
    handler = JobProgress()
    for level, message, fields in records:
        record = logging.LogRecord("snakemake", level, "", 0, message, (), None)
        vars(record).update(fields)
        handler.handle(record)
    handler.close()
    return stream.getvalue()


def test_a_log_has_a_line_for_every_job_that_starts_and_every_problem(monkeypatch):
    lines = shown(monkeypatch, io.StringIO()).splitlines()
    assert [line for line in lines if not line.startswith("job ")] == PROBLEMS
    first, second = (line for line in lines if line.startswith("job "))
    assert first.startswith("job 1 of 3, 0:00:0")
    assert first.endswith(": Attacking a: crop")
    assert second.startswith("job 2 of 3, ")


def test_a_terminal_has_a_bar_with_the_jobs_that_are_done(monkeypatch):
    text = shown(monkeypatch, Terminal())
    assert all(problem in text for problem in PROBLEMS)
    last = text.rpartition("MissingInput")[2]
    assert "1/3" in last
    assert "Rendering a" in last  # the last job, even after its end
    assert "Building" not in text


@pytest.mark.parametrize("quiet", [False, True])
def test_each_warning_in_the_logs_of_jobs_is_shown_once(monkeypatch, tmp_path, quiet):
    warnings = [
        "a/m.ply: mode mip",
        "b/m.ply: mode mip",
        "features: 3 of 9 rows stretch",
        "features: 4 of 9 rows stretch",
    ]
    records = []
    for i, warning in enumerate(warnings):
        log = tmp_path / f"{i}.log"
        log.write_text(f"progress\nwarning: {warning}\nthe last line, no warning: \n")
        job = {"event": "job_info", "jobid": i, "rule_msg": "Work", "rule_name": "work", "log": [str(log)]}
        records += [(logging.INFO, "", job), (logging.INFO, "", {"event": "job_finished", "job_id": i})]
    text = shown(monkeypatch, io.StringIO(), quiet=quiet, records=records)
    found = [line for line in text.splitlines() if "warning: " in line]
    assert found == [f"warning: {warnings[i]}" for i in (0, 2, 3)]


def test_quiet_shows_problems_only(monkeypatch):
    for stream in (io.StringIO(), Terminal()):
        assert shown(monkeypatch, stream, quiet=True).splitlines() == PROBLEMS


@pytest.mark.parametrize("message", ["Nothing to be done (all", "Terminating processes on user request"])
def test_the_end_of_a_run_without_jobs_is_said(monkeypatch, message):
    assert shown(monkeypatch, io.StringIO(), records=[(logging.INFO, message, {})]).splitlines() == [message]


def test_the_bar_shows_the_progress_of_the_newest_job(monkeypatch, tmp_path):
    log = tmp_path / "surface.log"
    log.write_text("device 0: pocl\nopacity field: 21 done in 47.8 s\nbisection: 2 of 8\nbisection: 3 of 8\nlast: of\n")
    fields = {"event": "job_info", "jobid": 7, "rule_msg": "Measuring a", "rule_name": "measure", "log": [str(log)]}
    text = shown(monkeypatch, Terminal(), records=[RUN[1], (logging.INFO, "", fields)])
    assert "bisection: 3 of 8 (Measuring a)" in text
    assert "2 of 8" not in text
