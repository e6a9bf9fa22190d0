"""Intervals and tests over scenes: coverage, exact p-values, and Holm's correction."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.metrics.statistics import holm, mean_interval, paired_test


def test_intervals_of_normal_scenes_cover_their_mean_as_often_as_they_claim():
    rng = np.random.default_rng(6)
    intervals = [mean_interval(list(rng.normal(2, 3, size=(6, 1)))) for _ in range(400)]
    covering = np.mean([interval.low <= 2 <= interval.high for interval in intervals])
    assert covering == pytest.approx(0.95, abs=0.04)  # four standard deviations


def test_three_scenes_give_their_range_and_its_own_level():
    assert mean_interval([[1.0, 3.0], [9.0], [4.0]]) == (5.0, 2.0, 9.0, 0.75, 3)


def brute_force(values):
    """Share of all signs whose mean lies as far from 0 as the observed one; integers, hence exact."""
    sums = [abs(np.dot(signs, values)) for signs in product((1, -1), repeat=len(values))]
    return np.mean(np.array(sums) >= abs(sum(values)))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(-20, 20).map(float), min_size=2, max_size=7))
def test_p_is_that_of_all_signs(values):
    assert paired_test([[value] for value in values]) == pytest.approx(min(1.0, brute_force(values)), abs=1e-12)


def test_signs_that_tie_on_a_decimal_grid_tie():
    """Differences of PSNRs with one decimal: their rounding errors exceed scipy's tolerance of ties."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        before = rng.integers(280, 320, rng.integers(2, 8))
        after = before + rng.integers(-5, 6, len(before))
        differences = [[first / 10 - second / 10] for first, second in zip(before, after, strict=True)]
        assert paired_test(differences) == pytest.approx(min(1.0, brute_force(before - after)), abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0, 1), max_size=6))
def test_holm_rejects_what_the_step_down_procedure_rejects(p):
    for level in (0.01, 0.05, 0.3):
        rejected = set()
        for step, test in enumerate(np.argsort(p, kind="stable")):
            if p[test] * (len(p) - step) > level:
                break
            rejected.add(int(test))
        assert {int(i) for i in np.flatnonzero(holm(p) <= level)} == rejected
