"""Adaptive pruning."""

import numpy as np
import pytest

from gspure.errors import InputError
from gspure.method.pruning import cluster_weights, mean_weight, plain_prune_mask, prune_mask


def test_equations_of_the_mean_weight_and_of_cluster_weights() -> None:
    assert mean_weight(np.array([1.0, 2.0, 6.0])) == 3.0
    assert mean_weight(np.zeros(0)) == 0.0
    labels = np.array([0, 1, -1, 1, 0, 1])
    assert cluster_weights(labels, np.array([1.0, 2.0, 100.0, 3.0, 5.0, 4.0])).tolist() == [3.0, 3.0]


def test_means_of_weights_do_not_depend_on_the_order_of_rows() -> None:
    rng = np.random.default_rng(0)
    weights, labels = rng.lognormal(0, 6, 5000), rng.integers(-1, 4, 5000)
    for _ in range(20):
        rows = rng.permutation(len(weights))
        assert mean_weight(weights[rows]) == mean_weight(weights)
        assert cluster_weights(labels[rows], weights[rows]).tolist() == cluster_weights(labels, weights).tolist()


def test_equation_of_pruning_judges_clusters_by_their_mean_and_noise_by_itself() -> None:
    #                  light cluster  heavy cluster  noise
    labels = np.array([0, 0, 0, 1, 1, -1, -1], np.int32)
    weights = np.array([0.0, 0.0, 3.0, 0.0, 12.0, 1.0, 5.0])  # mean 3
    assert prune_mask(labels, weights, tau_c=2, tau_n=2).tolist() == [True, True, True, False, False, True, False]


def test_each_factor_governs_its_own_kind() -> None:
    labels, weights = np.array([0, 0, -1, 1, 1]), np.array([1.0, 1.0, 1.0, 11.0, 11.0])  # mean 5
    assert prune_mask(labels, weights, tau_c=4, tau_n=6).tolist() == [True, True, False, False, False]
    assert prune_mask(labels, weights, tau_c=6, tau_n=4).tolist() == [False, False, True, False, False]


def test_the_plain_rule_removes_weights_below_a_share_of_the_mean_and_keeps_one_that_equals_it() -> None:
    assert plain_prune_mask(np.array([1.0, 3.0]), tau=2).tolist() == [False, False]
    assert plain_prune_mask(np.array([1.0, 3.0]), tau=0.8).tolist() == [True, False]


def test_weights_that_are_all_zero_and_no_gaussians_prune_nothing() -> None:
    assert not prune_mask(np.array([0, 0, -1]), np.zeros(3)).any()
    assert prune_mask(np.zeros(0, np.int32), np.zeros(0)).shape == (0,)


@pytest.mark.parametrize("tau", [0.0, -1.0, float("nan"), float("inf")])
def test_a_factor_that_is_not_positive_is_refused(tau: float) -> None:
    with pytest.raises(InputError, match="tau_c: expected a number above 0"):
        prune_mask(np.zeros(2, np.int32), np.ones(2), tau, 4.0)
    with pytest.raises(InputError, match="tau: expected a number above 0"):
        plain_prune_mask(np.ones(2), tau)
