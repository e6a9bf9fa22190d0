"""What people read: numbers as text, facts about results, progress on a terminal."""

import io
import math
import re
import sys
from collections.abc import Callable, Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.attacks import find_attack
from gspure.method.diagnosis import diagnose
from gspure.method.purify import Purification
from gspure.progress import Described, decimal, percent, signed, significant, track
from gspure.training.trainer import watched
from tests.models import blobs, camera


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown(monkeypatch: pytest.MonkeyPatch, run: Callable[[], Iterable[object]]) -> str:
    """Return what a wide terminal shows of a run."""
    terminal = Terminal()
    with monkeypatch.context() as patched:
        patched.setattr(sys, "stderr", terminal)
        patched.setenv("COLUMNS", "200")
        list(run())
    return terminal.getvalue()


MARKUP = "price [bold]5[/bold] [/]"
"""Rich would take the first tag for a command, and refuse the last one."""


def test_a_label_is_text_not_markup(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MARKUP in shown(monkeypatch, lambda: track([1, 2], MARKUP))


def test_the_state_of_a_run_is_text_not_markup(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MARKUP in shown(monkeypatch, lambda: watched([0.5], 1, lambda: MARKUP))


@pytest.mark.parametrize(
    ("share", "text"),
    [
        *zip(
            [0, 1, 0.0004, 0.9996, 0.0006, 0.9994, 1.03, -0.0, math.nan, math.inf],
            ["0.0%", "100.0%", "<0.1%", ">99.9%", "0.1%", "99.9%", "103.0%", "0.0%", "–", "–"],
            strict=True,
        )
    ],
)
def test_only_none_and_all_are_0_and_100_percent(share: float, text: str) -> None:
    assert percent(share) == text


@given(st.floats(0, 1), st.integers(0, 4))
def test_a_share_rounds_to_none_or_all_only_if_it_is(share: float, decimals: int) -> None:
    text = percent(share, decimals)
    assert (text == percent(0, decimals)) == (share == 0)
    assert (text == percent(1, decimals)) == (share == 1)


@pytest.mark.parametrize(
    ("value", "plain", "change"),
    [
        *zip(
            [1.001, -2.25, -0.001, -0.0, math.nan, math.inf, -math.inf, 1e9],
            ["1.00", "−2.25", "0.00", "0.00", "–", "∞", "−∞", "1.00e+09"],
            ["+1.00", "−2.25", "+0.00", "+0.00", "–", "–", "–", "+1.00e+09"],
            strict=True,
        )
    ],
)
def test_zero_has_no_sign_and_unknown_numbers_are_dashes(value: float, plain: str, change: str) -> None:
    assert (decimal(value), signed(value)) == (plain, change)


@pytest.mark.parametrize(
    ("value", "text"), [(0.00431, "0.00431"), (53.125, "53.1"), (-0.0, "0"), (-4e-5, "−4e−05"), (math.nan, "–")]
)
def test_numbers_of_unknown_magnitude_keep_their_first_digits(value: float, text: str) -> None:
    assert significant(value) == text


def purification():
    labels, weights = np.array([0, 0, -1, -1], np.int32), np.array([4.0, 4.0, 4.0, 0.1], np.float32)
    diagnosis = diagnose(labels, weights, 4, 4, 0)
    return Purification(blobs(3), weights, labels, weights < 1, diagnosis)


@pytest.mark.parametrize(
    ("thing", "line"),
    [
        (lambda: blobs(1234, sh_degree=2), r"Gaussians\(rows: 1,234, SH degree: 2, .*extent of 90 %: .* x .* x "),
        (lambda: blobs(3)[:0], r"Gaussians\(rows: 0, "),
        (lambda: camera(40, 30, name="left"), r"Camera\(name: left, size: 40x30, focal length: 60 px, centre: "),
        (lambda: find_attack("random_pruning").apply(blobs(8), fraction=0.25), r"Attacked\(rows: 6, kept: 6 of 8\)"),
        (purification, r"Purification\(rows: 4, clusters: 1, pruned rows: 25.0%, "),
    ],
)
def test_a_result_is_one_line_in_a_terminal_and_a_table_in_a_notebook(thing, line):
    assert re.match(line, repr(thing()))
    assert "\n" not in repr(thing())
    assert thing()._repr_html_().count("<tr>") == len(thing().facts)


def test_names_cannot_bring_markup_into_a_notebook():
    class Named(Described):
        facts = {"name": "<script>"}  # noqa: RUF012

    assert "<script>" not in Named()._repr_html_()
