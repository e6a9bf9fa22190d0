"""Weights of Gaussians over the views."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.errors import InputError
from gspure.method.diagnosis import diagnose
from gspure.method.weights import (
    accumulate,
    evenly_spread,
    few_in_view,
    heavy_rows,
    holding_rows,
    require_in_view,
    view_weights,
)
from gspure.renderer import CONTRIBUTION


def stage(*rows: tuple[int, float, float, int]) -> np.ndarray:
    return np.array(list(rows), CONTRIBUTION)


def test_equation_of_view_accumulated_weights_counts_the_views_that_do_not_see_a_gaussian() -> None:
    seen_twice, seen_once = stage((0, 3.0, 0.5, 6), (2, 1.0, 0.25, 4)), stage((0, 1.0, 0.75, 2))
    weights = accumulate(iter([seen_twice, seen_once]), 3)
    assert weights.tolist() == [2.0, 0.0, 0.5]
    assert weights.dtype == np.float32


@pytest.mark.parametrize(("reduction", "expected"), [("sum", 3.0), ("max", 0.5), ("mean_touched", 0.375)])
def test_reduction_over_the_pixels_of_a_view(reduction: str, expected: float) -> None:
    assert view_weights(stage((0, 3.0, 0.5, 8)), reduction).tolist() == [expected]


def test_many_small_contributions_survive_beside_a_large_one() -> None:
    small = [stage((0, 1e-4, 1e-4, 1)) for _ in range(9999)]
    weights = accumulate([stage((0, 1e6, 1.0, 1)), *small], 1)  # a float32 sum would lose every one of the small
    assert weights[0] == np.float32((1e6 + 9999 * np.float64(np.float32(1e-4))) / 10000)


@given(st.integers(1, 60), st.data())
def test_fewer_views_are_spread_evenly(count: int, data: st.DataObject) -> None:
    views = data.draw(st.integers(1, count))
    chosen = evenly_spread(range(count), views)
    steps = np.diff(chosen)
    assert len(chosen) == views
    assert ((steps >= count // views) & (steps <= -(-count // views))).all()
    assert abs(chosen[0] - (count - 1 - chosen[-1])) <= 1
    assert evenly_spread(range(count), count) == list(range(count))


@pytest.mark.parametrize("views", [-1, 0, 4])
def test_more_views_than_there_are_and_none_are_refused(views: int) -> None:
    with pytest.raises(InputError, match="1 to 3"):
        evenly_spread("abc", views)


def test_no_views_and_an_unknown_reduction_are_refused() -> None:
    with pytest.raises(InputError, match="at least one"):
        accumulate([], 3)
    with pytest.raises(InputError, match="one of sum, max, mean_touched"):
        accumulate([stage((0, 1.0, 1.0, 1))], 1, "median")


def test_weights_of_rows_that_no_view_shows_are_refused() -> None:
    require_in_view(np.array([0.0, 0.1, 0.0]))
    with pytest.raises(InputError, match="rows: expected at least one in view, found none of 3"):
        require_in_view(np.zeros(3))


@pytest.mark.parametrize(
    ("rows", "weight", "is_heavy"), [(2001, 223.0, True), (2001, 222.0, False), (501, 126.0, True), (200, 199.0, False)]
)
def test_a_row_is_heavy_beyond_a_tenth_of_all_weights_or_a_hundred_times_their_mean(rows, weight, is_heavy) -> None:
    weights = np.ones(rows)
    weights[5] = weight
    assert heavy_rows(weights).tolist() == [5] * is_heavy


def test_views_that_see_less_than_a_hundredth_of_the_rows_are_named() -> None:
    assert few_in_view(100, 10_000) == []
    assert len(few_in_view(99, 10_000)) == 1


def test_the_heaviest_rows_that_hold_99_percent_of_all_weight_are_counted() -> None:
    assert holding_rows(np.array([30.0, *[0.01] * 50, 60.0, 9.5])) == 3
    assert holding_rows(np.array([0.5, 98.6, 0.9])) == 2
    assert holding_rows(np.array([0.0, 1.0, 0.0])) == 1
    assert holding_rows(np.zeros(4)) == 4


@pytest.mark.parametrize(("rows", "warned"), [(10, False), (11, True)])
def test_more_than_five_times_the_rows_that_hold_99_percent_of_all_weight_are_warned_of(rows, warned) -> None:
    weights = np.where(np.arange(rows) < 2, 1.0, 0.0)
    assert any("lower the thresholds" in text for text in diagnose(np.full(rows, -1), weights).warnings) == warned
