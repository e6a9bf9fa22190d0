"""Whether a message can be distinguished from controls: the area under the curve and its interval."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.evaluation.significance import detectability

VALUES = st.lists(st.integers(0, 6).map(float) | st.just(np.inf), min_size=1, max_size=8)


@settings(max_examples=60, deadline=None)
@given(VALUES, VALUES)
def test_the_area_is_the_share_of_pairs_won_with_ties_for_half(assets, controls):
    won = [1.0 if x > y else 0.5 if x == y else 0.0 for x, y in product(assets, controls)]
    found = detectability(assets, controls)
    assert found.auc == pytest.approx(np.mean(won))
    assert 0 <= found.low <= found.auc <= found.high <= 1


@settings(max_examples=30, deadline=None)
@given(VALUES, VALUES)
def test_assets_and_controls_exchanged_mirror_the_interval(assets, controls):
    there, back = detectability(assets, controls), detectability(controls, assets)
    np.testing.assert_allclose([back.auc, back.low, back.high], [1 - there.auc, 1 - there.high, 1 - there.low])


def test_hanley_and_mcneils_109_images():
    # Hanley and McNeil 1982, table I: ratings 1 to 5 of 58 normal and 51 abnormal images; area 0.893, error 0.032.
    normal = np.repeat([1, 2, 3, 4, 5], [33, 6, 6, 11, 2])
    abnormal = np.repeat([1, 2, 3, 4, 5], [3, 2, 2, 11, 33])
    found = detectability(abnormal, normal)
    assert found.auc == pytest.approx(0.893, abs=5e-4)
    assert (found.high - found.low) / 2 == pytest.approx(1.96 * 0.032, rel=0.05)


def test_a_perfect_separation_of_few_is_not_certain():
    few, many = detectability([3, 4, 5], [0, 1, 2]), detectability(range(30, 60), range(30))
    assert few.auc == many.auc == few.high == 1
    assert few.low == pytest.approx(0.50, abs=0.005)
    assert many.low > 0.85


def test_95_percent_of_intervals_cover_the_true_area():
    rng = np.random.default_rng(2)
    truth = 0.7602499389065233  # of N(1, 1) against N(0, 1): the normal distribution at 1 / sqrt(2)
    found = [detectability(rng.normal(1, 1, 8), rng.normal(0, 1, 12)) for _ in range(600)]
    assert np.mean([interval.low <= truth <= interval.high for interval in found]) == pytest.approx(0.95, abs=0.03)
