"""Intervals and tests over scenes: coverage, exact p-values, and Holm's correction."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.paired_tests import holm, paired_test
from gspure.metrics.statistics import mean_interval


@pytest.mark.parametrize(("scenes", "seeds", "share"), [(6, 1, 0.933), (6, 3, 0.969), (9, 1, 0.944), (9, 3, 0.973)])
def test_intervals_of_normal_scenes_cover_their_mean_as_often_as_measured(scenes, seeds, share):
    rng = np.random.default_rng(scenes)
    of_scenes = rng.normal(2, 3, size=(1500, scenes, 1))
    of_seeds = rng.normal(0, 3, size=(1500, scenes, seeds)) if seeds > 1 else 0
    intervals = [mean_interval(list(draw)) for draw in of_scenes + of_seeds]
    covering = np.mean([interval.low <= 2 <= interval.high for interval in intervals])
    assert covering == pytest.approx(share, abs=0.026 if seeds == 1 else 0.018)  # four standard deviations


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
