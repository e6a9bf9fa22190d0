"""Bootstrap intervals over scenes and seeds: coverage, invariance, few scenes."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gspure.evaluation.intervals import by_scene, differences, mean_interval

DECIBELS = st.floats(-30, 30, allow_subnormal=False)
SCENES = st.lists(st.lists(DECIBELS, min_size=1, max_size=3), min_size=1, max_size=9)


def coverage(draw: Callable[[], NDArray[np.float64]], truth: float, trials: int = 250) -> float:
    found = [mean_interval(list(draw())) for _ in range(trials)]
    return float(np.mean([interval.low <= truth <= interval.high for interval in found]))


@settings(max_examples=30, deadline=None)
@given(SCENES, st.randoms(use_true_random=False))
def test_the_order_of_scenes_and_seeds_changes_no_bit(values, random):
    shuffled = [random.sample(group, len(group)) for group in random.sample(values, len(values))]
    assert mean_interval(values) == mean_interval(shuffled)


@settings(max_examples=30, deadline=None)
@given(SCENES)
def test_the_interval_holds_the_mean_and_stays_within_the_data(values):
    interval = mean_interval(values)
    slack = 1e-9
    assert interval.low - slack <= interval.mean <= interval.high + slack
    flat = [value for group in values for value in group]
    assert min(flat) - slack <= interval.low <= interval.high <= max(flat) + slack


def test_every_scene_counts_the_same_however_many_seeds_it_has():
    assert mean_interval([[0.0] * 9, [3.0], [6.0, 6.0]]).mean == 3.0


@pytest.mark.parametrize(("scenes", "one_seed", "three_seeds"), [(6, 0.933, 0.969), (9, 0.944, 0.973)])
def test_intervals_of_normal_scenes_cover_their_mean_as_often_as_the_docs_say(scenes, one_seed, three_seeds):
    rng = np.random.default_rng(scenes)
    # Of 1,500 trials, four standard deviations are 2.6 and 1.8 %.
    assert coverage(lambda: rng.normal(2, 3, size=(scenes, 1)), 2, 1500) == pytest.approx(one_seed, abs=0.026)
    both = coverage(lambda: rng.normal(2, 3, size=(scenes, 1)) + rng.normal(0, 3, size=(scenes, 3)), 2, 1500)
    assert both == pytest.approx(three_seeds, abs=0.018)


def test_three_scenes_give_their_range_and_its_own_level():
    interval = mean_interval([[1.0, 3.0], [9.0], [4.0]])
    assert (interval.low, interval.high, interval.level, interval.scenes) == (2.0, 9.0, 0.75, 3)


@pytest.mark.parametrize(("scenes", "level"), [(3, 0.75), (5, 0.9375)])
def test_the_range_of_few_scenes_covers_the_median_as_often_as_it_says(scenes, level):
    rng = np.random.default_rng(scenes)
    # A skewed distribution, since the level holds for any; ranges cost nothing, so trials are many.
    found = coverage(lambda: rng.exponential(size=(scenes, 1)), np.log(2), trials=4000)
    assert found == pytest.approx(level, abs=0.03)
    assert mean_interval(list(rng.exponential(size=(scenes, 1)))).level == level


def test_cells_are_grouped_by_scene_and_paired_where_both_are():
    a = {("room", 2): 5.0, ("room", 1): 3.0, ("bonsai", 1): 8.0}
    assert [group.tolist() for group in by_scene(a)] == [[8.0], [3.0, 5.0]]
    b = {("room", 1): 1.0, ("bonsai", 1): 2.0, ("kitchen", 1): 9.0}
    assert [group.tolist() for group in by_scene(differences(a, b))] == [[6.0], [2.0]]
