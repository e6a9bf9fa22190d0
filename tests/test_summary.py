"""Means over scenes with intervals, as CSV and as LaTeX."""

import math

import pytest

from gspure.evaluation.summary import summarize
from tests.contest_cases import BEFORE, outcome


def of_scheme(scheme, place, variant, **psnr):
    return outcome(variant, place, scheme=scheme, targets=psnr)


@pytest.fixture
def outcomes():
    """Three scenes of one scheme, seven of another."""
    few = [of_scheme("my_scheme", f"s{i}", "gspure", scene=29.0, message=10.0 + i) for i in range(3)]
    controls = [of_scheme("my_scheme", f"s{i}", "wrong_key", scene=30.0, message=8.0) for i in range(3)]
    many = [of_scheme("splats_in_splats", f"s{i}", "gspure", scene=28.0, message=10.0 + i) for i in range(7)]
    return [*few, *controls, *many]


def test_rows_are_means_over_scenes_in_the_order_of_outcomes(outcomes):
    rows = summarize(outcomes)
    assert [row.condition.scheme for row in rows] == ["my_scheme", "my_scheme", "splats_in_splats"]
    assert [row.variant for row in rows] == ["gspure", "wrong_key", "gspure"]
    assert [row.message.mean for row in rows] == [11.0, 8.0, 13.0]
    assert [row.message.scenes for row in rows] == [3, 3, 7]
    assert rows[0].score.mean == (BEFORE["message"] - 11) - (BEFORE["scene"] - 29)


def test_a_control_has_no_score_and_only_the_papers_schemes_have_the_papers(outcomes):
    ours, control, theirs = summarize(outcomes)
    assert control.score is None
    assert math.isnan(ours.paper_score)
    assert theirs.paper_score == 15.21
