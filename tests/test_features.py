"""Standardized features."""

import numpy as np
import pytest

from gspure.errors import InputError
from gspure.method.features import PARTS, joint_features, standardize, take


def test_equation_of_features_concatenates_position_opacity_and_weight_each_standardized() -> None:
    rng = np.random.default_rng(0)
    means, opacities, weights = rng.normal(5, 3, (40, 3)), rng.uniform(0, 1, 40), rng.lognormal(0, 2, 40)
    found = joint_features(means, opacities, weights)
    assert found.shape == (40, 5)
    assert found.dtype == np.float64
    for column, raw in enumerate([*means.T, opacities, weights]):
        np.testing.assert_allclose(found[:, column], (raw - raw.mean()) / raw.std(), rtol=1e-12, atol=1e-12)


def test_a_constant_column_becomes_zero_even_where_its_mean_is_rounded() -> None:
    columns = np.full((7, 1), 0.1)
    assert columns.std() > 0  # what a guard on the deviation would fall for
    assert not standardize(columns).any()
    assert joint_features(np.ones((1, 3)), np.ones(1), np.ones(1)).tolist() == [[0.0] * 5]


def test_rows_that_are_not_finite_are_refused_with_their_number() -> None:
    means = np.zeros((6, 3))
    means[2, 1], means[4, 0] = np.nan, np.inf
    with pytest.raises(InputError, match=r"features: x, y: .* 2 of 6 rows, first in row 2"):
        joint_features(means, np.full(6, 0.5), np.ones(6))


def test_parts_are_columns_in_their_own_order_whatever_that_of_asking() -> None:
    found = np.arange(10.0).reshape(2, 5)
    assert take(found, ["weight", "position"]).tolist() == [[0, 1, 2, 4], [5, 6, 7, 9]]
    assert take(found, ["opacity"]).tolist() == [[3], [8]]
    assert take(found, PARTS).tolist() == found.tolist()


@pytest.mark.parametrize("distance", [300, 1e4, 1e5, 1e30, 3e38])
def test_far_rows_change_the_features_of_no_other_row(distance: float) -> None:
    rng = np.random.default_rng(0)
    means, opacities, weights = rng.normal(5, 3, (200, 3)), rng.uniform(0, 1, 200), rng.lognormal(0, 2, 200)
    alone = joint_features(means, opacities, weights)
    planted = np.array([[distance, 0, 0], [0, -distance, 5], [distance, distance, distance]])
    found = joint_features(np.concatenate([planted, means]), [1, 0, 0.5, *opacities], [1e9, 0, 3, *weights])
    np.testing.assert_array_equal(found[3:], alone)
    assert np.abs(found).max() == 1e6
    assert (np.abs(found[:3, :3]).max(axis=1) > 20 * np.abs(alone[:, :3]).max()).all()


@pytest.mark.parametrize(("far", "distance", "warned"), [(5, 20.5, False), (6, 20.0, False), (6, 20.5, True)])
def test_more_than_a_twentieth_of_the_rows_beyond_20_extents_of_the_middle_half_are_too_many_to_leave_out(
    far: int, distance: float, warned: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of 100 rows, the middle half is 1 wide; six rows at 10 and the far ones stretch the extent itself."""
    x = np.repeat([-0.5, 0.0, 0.5, 10.0, distance], [30, 34 - far, 30, 6, far])
    joint_features(np.column_stack([x, 0 * x, 0 * x]), np.ones(100), np.ones(100))
    assert ("too many to leave out" in capsys.readouterr().err) == warned


def stretched(count: int, distance: float) -> np.ndarray:
    """Places of which one in twelve is away from the median, so that the extent is 1, and one is further."""
    places = np.zeros(count)
    places[:-1:12] = 1
    places[-1] = distance
    return places


@pytest.mark.parametrize(
    ("x", "left_out", "warning"),
    [
        (stretched(300, 10.0), 0, ""),
        (stretched(400, 10.5), 1, "1 of 400 stretch the positions 2.11 times, so"),
        (stretched(1600, 10.5), 0, "1 of 1600 stretch the positions 1.37 times"),
        (stretched(8000, 10.5), 0, ""),
        (np.repeat([1.0, -1.0, -22.0, 22.0], [160, 160, 1, 1]), 0, "2 of 322 stretch the positions 2 times\n"),
    ],
    ids=["near", "2.1 times", "1.4 times", "1.09 times", "twice"],
)
def test_rows_beyond_ten_extents_count_unless_they_stretch_the_positions_more_than_twice(
    x: np.ndarray, left_out: int, warning: str, capsys: pytest.CaptureFixture[str]
) -> None:
    means = np.column_stack([x, 0 * x, 0 * x])
    expected = standardize(means, np.arange(len(x)) < len(x) - left_out)
    assert joint_features(means, 0 * x, 0 * x)[:, :3].tobytes() == expected.tobytes()
    text = capsys.readouterr().err
    assert warning in text if warning else not text
