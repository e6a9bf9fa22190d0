"""Standardized features."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gspure.errors import InputError
from gspure.method.features import OUTLYING, features, standardize, take
from gspure.model.summary import extent_and_distances

COLUMNS = hnp.arrays(np.float64, st.tuples(st.integers(2, 30), st.just(3)), elements=st.floats(-1e3, 1e3, width=32))


def test_equation_of_features_concatenates_position_opacity_and_weight_each_standardized() -> None:
    rng = np.random.default_rng(0)
    means, opacities, weights = rng.normal(5, 3, (40, 3)), rng.uniform(0, 1, 40), rng.lognormal(0, 2, 40)
    found = features(means, opacities, weights)
    assert found.shape == (40, 5)
    assert found.dtype == np.float64
    for column, raw in enumerate([*means.T, opacities, weights]):
        np.testing.assert_allclose(found[:, column], (raw - raw.mean()) / raw.std(), rtol=1e-12, atol=1e-12)


@given(COLUMNS)
def test_columns_have_mean_zero_and_deviation_one_or_are_constant_zero(columns: np.ndarray) -> None:
    found = standardize(columns)
    np.testing.assert_allclose(found.mean(axis=0), 0, atol=1e-9)
    varies = columns.min(axis=0) != columns.max(axis=0)
    assert not found[:, ~varies].any()
    wide = np.ptp(columns, axis=0) > 1e-6  # below, the deviation itself is rounding
    np.testing.assert_allclose(found[:, wide].std(axis=0), 1, rtol=1e-9)


def test_the_features_of_a_row_do_not_depend_on_the_order_of_rows() -> None:
    rng = np.random.default_rng(0)
    columns = rng.lognormal(0, 3, (5000, 5))
    rows = rng.permutation(len(columns))
    np.testing.assert_array_equal(standardize(columns[rows]), standardize(columns)[rows])


def test_rows_that_are_not_finite_are_refused_with_their_number() -> None:
    means = np.zeros((6, 3))
    means[2, 1], means[4, 0] = np.nan, np.inf
    with pytest.raises(
        InputError, match="features: x, y: expected finite values, found others in 2 of 6 rows, first in row 2"
    ):
        features(means, np.full(6, 0.5), np.ones(6))


@pytest.mark.parametrize("distance", [300, 1e4, 1e5, 1e30, 3e38])
def test_far_rows_change_the_features_of_no_other_row(distance: float) -> None:
    rng = np.random.default_rng(0)
    means, opacities, weights = rng.normal(5, 3, (200, 3)), rng.uniform(0, 1, 200), rng.lognormal(0, 2, 200)
    alone = features(means, opacities, weights)
    planted = np.array([[distance, 0, 0], [0, -distance, 5], [distance, distance, distance]])
    found = features(np.concatenate([planted, means]), [1, 0, 0.5, *opacities], [1e9, 0, 3, *weights])
    np.testing.assert_array_equal(found[3:], alone)
    assert np.isfinite(found).all()
    assert (np.abs(found[:3, :3]).max(axis=1) > 20 * np.abs(alone[:, :3]).max()).all()


@given(COLUMNS)
def test_parts_are_standardized_as_if_they_were_alone(columns: np.ndarray) -> None:
    assume((extent_and_distances(columns)[1] <= OUTLYING).all())
    rest = np.arange(len(columns))
    found = features(columns, rest, rest**2)
    np.testing.assert_array_equal(take(found, ["position"]), standardize(columns))
