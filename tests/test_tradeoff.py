"""The Pareto front and attacks at equal damage."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.evaluation.tradeoff import matched_message_drop, pareto_front

POINTS = st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), min_size=1, max_size=12)
SWEEP = ([0.0, 0.5, 1.0, 2.0], [0.0, 4.0, 6.0, 10.0])  # scene drop, message drop


def test_dominated_points_are_not_on_the_front():
    damage, residual = [0.2, 1.0, 1.0, 3.0, 0.2], [20, 12, 14, 12, 20]
    assert pareto_front(damage, residual).tolist() == [True, True, False, False, True]


@given(POINTS)
def test_the_front_is_what_brute_force_finds(points):
    front = [not any(x <= a and y <= b and (x, y) != (a, b) for x, y in points) for a, b in points]
    assert pareto_front(*zip(*points, strict=True)).tolist() == front


@given(POINTS, st.randoms(use_true_random=False), st.integers(0, 8))
def test_neither_order_nor_dominated_strengths_change_the_comparison(points, random, at):
    found = matched_message_drop(*zip(*points, strict=True), at)
    shuffled = random.sample(points, len(points))
    assert matched_message_drop(*zip(*shuffled, strict=True), at) == found
    worse = (max(x for x, _ in points), min(y for _, y in points))
    assert matched_message_drop(*zip(*points, worse, strict=True), at) == found


@given(POINTS, st.integers(0, 8))
def test_at_a_measured_damage_the_best_setting_up_to_it_counts(points, at):
    found = matched_message_drop(*zip(*points, strict=True), at)
    damages = [x for x, _ in points]
    if at in damages:
        best = max(y for x, y in points if x <= at)
        assert found >= best
        if (at, best) in points and all(y < best for x, y in points if x < at):
            assert found == best


@pytest.mark.parametrize(("at", "drop"), [(0.0, 0.0), (0.25, 2.0), (0.5, 4.0), (1.5, 8.0), (2.0, 10.0)])
def test_between_settings_the_drop_is_linear(at, drop):
    assert matched_message_drop(*SWEEP, at) == drop


def test_nothing_is_extrapolated():
    assert matched_message_drop(*SWEEP, 2.01) is None
    assert matched_message_drop([5.0], [20.0], 2.0) is None


def test_a_dominated_strength_is_skipped():
    assert matched_message_drop([0.0, 1.0, 2.0], [0.0, 9.0, 3.0], 1.5) == 9.0
