"""The paired test against brute force and scipy's own cases, and Holm's correction."""

from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.evaluation.significance import DRAWS, holm, paired_test

DIFFERENCES = st.lists(st.integers(-20, 20).map(float), min_size=2, max_size=7)


def brute_force(values):
    """Share of all signs whose mean lies as far from 0 as the observed one; integers, hence exact."""
    sums = [abs(np.dot(signs, values)) for signs in product((1, -1), repeat=len(values))]
    return np.mean(np.array(sums) >= abs(sum(values)))


@settings(max_examples=60, deadline=None)
@given(DIFFERENCES)
def test_p_is_that_of_all_signs(values):
    assert paired_test([[value] for value in values]).p == pytest.approx(min(1.0, brute_force(values)), abs=1e-12)


def test_signs_that_tie_on_a_decimal_grid_tie():
    """Differences of PSNRs with one decimal: their rounding errors exceed scipy's tolerance of ties."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        before = rng.integers(280, 320, rng.integers(2, 8))
        after = before + rng.integers(-5, 6, len(before))
        differences = [[first / 10 - second / 10] for first, second in zip(before, after, strict=True)]
        assert paired_test(differences).p == pytest.approx(min(1.0, brute_force(before - after)), abs=1e-12)


@settings(max_examples=30, deadline=None)
@given(DIFFERENCES, st.randoms(use_true_random=False))
def test_neither_the_order_of_scenes_nor_the_side_matters(values, random):
    test = paired_test([[value] for value in values])
    assert paired_test([[value] for value in random.sample(values, len(values))]) == test
    mirrored = paired_test([[-value] for value in values])
    assert (mirrored.p, mirrored.difference) == (test.p, -test.difference)


def test_seeds_of_a_scene_are_not_independent_evidence():
    once = paired_test([[1.0], [2.0], [3.0], [4.0]])
    often = paired_test([[1.0] * 5, [2.0] * 5, [3.0] * 5, [4.0] * 5])
    assert often == once
    assert once.p == 2 / 2**4


def test_seeds_that_cancel_but_for_rounding_are_no_difference():
    assert sum([0.1, 0.2, -0.3]) != 0
    assert paired_test([[0.1, 0.2, -0.3]] * 7)[:2] == (0, 1)


@pytest.mark.parametrize(("scenes", "smallest"), [(1, 1.0), (3, 0.25), (5, 0.0625), (6, 0.03125)])
def test_few_scenes_cannot_be_significant_and_the_test_says_so(scenes, smallest):
    test = paired_test([[100.0 + scene] for scene in range(scenes)])
    assert (test.p, test.smallest_p, test.scenes) == (smallest, smallest, scenes)


def test_many_scenes_are_sampled_repeatably_and_p_is_never_0():
    values = np.random.default_rng(0).normal(3, 1, size=(20, 2))
    test = paired_test(list(values))
    assert test == paired_test(list(values[::-1]))
    assert test.p == test.smallest_p == pytest.approx(2 / (DRAWS + 1))


def test_a_true_null_is_rejected_no_more_often_than_the_level():
    rng = np.random.default_rng(5)
    p = [paired_test(list(rng.normal(size=(7, 1)) + rng.normal(size=(7, 3)))).p for _ in range(400)]
    assert 0.02 <= np.mean(np.array(p) <= 0.05) <= 0.09


def test_holm_is_exact_on_its_textbook_case():
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0, 1), max_size=6))
def test_holm_rejects_what_the_step_down_procedure_rejects(p):
    for level in (0.01, 0.05, 0.3):
        rejected, order = set(), np.argsort(p, kind="stable")
        for step, test in enumerate(order):
            if p[test] * (len(p) - step) > level:
                break
            rejected.add(int(test))
        assert {int(i) for i in np.flatnonzero(holm(p) <= level)} == rejected


def test_holm_does_not_depend_on_the_order_of_the_family():
    p = [0.2, 0.01, 0.04, 0.01]
    for order in permutations(range(4)):
        np.testing.assert_array_equal(holm([p[i] for i in order]), holm(p)[list(order)])
