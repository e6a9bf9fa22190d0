"""What people read: numbers as text, facts about results, progress on a terminal."""

import io
import json
import math
import os
import sys

import numpy as np
import pytest

from gspure import progress
from gspure.attacks import find_attack
from gspure.method.diagnosis import diagnose
from gspure.method.purify import Purification
from gspure.progress import EVENTS, JOB, reported, track
from gspure.text import decimal, p_value, percent, signed, significant
from gspure.training.trainer import watched
from tests.models import blobs, camera

MARKUP = "price [bold]5[/bold] [/]"
"""Rich would take the first tag for a command, and refuse the last one."""


@pytest.mark.parametrize("run", [lambda: track([1, 2], MARKUP), lambda: watched([0.5], 1, lambda: MARKUP)])
def test_labels_and_states_are_text_not_markup(monkeypatch, run):
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    with monkeypatch.context() as patched:
        patched.setattr(sys, "stderr", terminal)
        patched.setenv("COLUMNS", "200")
        list(run())
    assert MARKUP in terminal.getvalue()


def test_a_job_reports_the_share_that_is_done_and_the_time_left(tmp_path, monkeypatch):
    pipe = tmp_path / "events"
    os.mkfifo(pipe)
    monkeypatch.setenv(EVENTS, str(pipe))
    monkeypatch.setenv(JOB, "a.log")
    monkeypatch.setattr(progress, "_SECONDS_BETWEEN_EVENTS", 0.9)
    clock = iter(range(99))
    monkeypatch.setattr("time.monotonic", lambda: float(next(clock)))  # a second passes for each item
    assert list(reported("cd", "train", 4, done=2)) == ["c", "d"]  # nobody reads
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    assert list(reported("cdef", "train", 6, done=2)) == ["c", "d", "e", "f"]
    events = [json.loads(line) for line in os.read(reader, 9999).splitlines()]
    assert {(event["event"], event["log"], event["part"]) for event in events} == {("part", "a.log", "train")}
    assert [event["share"] for event in events] == pytest.approx([3 / 6, 4 / 6, 5 / 6, 1])
    assert [event["left"] for event in events] == pytest.approx([3, 2, 1, 0])


@pytest.mark.parametrize(
    ("form", "values", "texts"),
    [
        (percent, (0.0004, 0.9996, 1.03, math.nan), "<0.1% >99.9% 103.0% –"),
        (decimal, (1.001, -2.25, -0.001, -math.inf, 1e9), "1.00 −2.25 0.00 −∞ 1.00e+09"),
        (signed, (1.001, -2.25, -0.001, math.inf), "+1.00 −2.25 +0.00 –"),
        (p_value, (0.005, 0.00501, 0.0054, 1 / 3, 1.0, math.nan), "0.005 0.0051 0.0054 0.34 1 –"),
        (significant, (0.00431, 53.125, -4e-5), "0.00431 53.1 −4e−05"),
    ],
)
def test_numbers_are_written_for_reading(form, values, texts):
    assert [form(value) for value in values] == texts.split()


def test_a_result_is_one_line_in_a_terminal_and_a_table_in_a_notebook():
    labels, weights = np.array([0, 0, -1, -1], np.int32), np.array([4.0, 4.0, 4.0, 0.1], np.float32)
    purification = Purification(blobs(3), weights, labels, weights < 1, diagnose(labels, weights, 4, 4, 0))
    attacked = find_attack("random_pruning").apply(blobs(8), fraction=0.25)
    for thing in (blobs(1234, sh_degree=2), camera(40, 30, name="left"), attacked, purification):
        assert "\n" not in repr(thing)
        assert thing._repr_html_().count("<tr>") == len(thing.facts)
