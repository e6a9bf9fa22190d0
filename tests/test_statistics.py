"""Intervals and tests over scenes: coverage, exact p-values, and Holm's correction."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from experiments.roc import detectability
from gspure.metrics.statistics import holm, mean_interval, paired_test


def coverage(draw: Callable[[], NDArray[np.float64]], truth: float, trials: int = 250) -> float:
    intervals = [mean_interval(list(draw())) for _ in range(trials)]
    return float(np.mean([interval.low <= truth <= interval.high for interval in intervals]))


@pytest.mark.parametrize(("scenes", "one_seed", "three_seeds"), [(6, 0.933, 0.969), (9, 0.944, 0.973)])
def test_intervals_of_normal_scenes_cover_their_mean_as_often_as_the_docs_say(scenes, one_seed, three_seeds):
    rng = np.random.default_rng(scenes)
    # Of 1,500 trials, four standard deviations are 2.6 and 1.8 %.
    assert coverage(lambda: rng.normal(2, 3, size=(scenes, 1)), 2, 1500) == pytest.approx(one_seed, abs=0.026)
    both = coverage(lambda: rng.normal(2, 3, size=(scenes, 1)) + rng.normal(0, 3, size=(scenes, 3)), 2, 1500)
    assert both == pytest.approx(three_seeds, abs=0.018)


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


def test_hanley_and_mcneils_109_images():
    # Hanley and McNeil 1982, table I: ratings 1 to 5 of 58 normal and 51 abnormal images; area 0.893, error 0.032.
    normal = np.repeat([1, 2, 3, 4, 5], [33, 6, 6, 11, 2])
    abnormal = np.repeat([1, 2, 3, 4, 5], [3, 2, 2, 11, 33])
    area = detectability(abnormal, normal)
    assert area.auc == pytest.approx(0.893, abs=5e-4)
    assert (area.high - area.low) / 2 == pytest.approx(1.96 * 0.032, rel=0.05)
