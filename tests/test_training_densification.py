"""Cloning, splitting, pruning and opacity resets."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.opencl.trainable import Parameters, TrainState
from gspure.training import densification
from gspure.training.densification import plan, reset_opacities
from tests.camera_cases import rotation_from
from tests.training_cases import same_bits, state, statistics

SMALL = 1e-4  # a mean gradient below the threshold
LARGE = 3e-4  # above it


def opaque(count, size=0.05, **columns):
    """A state in which nothing is pruned, with random moments; `columns` replace parameters."""
    random = state(count, size=size)
    logits = np.full(count, 2.0, np.float32)
    parameters = Parameters(**{**vars(random.parameters), "opacity_logits": logits, **columns})
    return TrainState(parameters, random.first, random.second)


def grow(before, gradients, *, extent=1.0, prune_big=False, seed=0, **settings):
    rng = np.random.default_rng(seed)
    growth = plan(before.parameters, statistics(gradients), extent=extent, prune_big=prune_big, rng=rng, **settings)
    return densification.grow(before, growth)


def rows_of(before, rows):
    return TrainState(*(Parameters(*(array[rows] for array in vars(part).values())) for part in vars(before).values()))


def test_a_gradient_is_the_mean_over_the_views_that_show_the_gaussian():
    before = opaque(3, size=0.001)
    collected = statistics([LARGE, SMALL, 0.0], views=[10, 10, 0])
    growth = plan(before.parameters, collected, extent=1.0, prune_big=False, rng=np.random.default_rng(0))
    after = densification.grow(before, growth)
    assert len(after.parameters) == 4
    np.testing.assert_array_equal(after.parameters.means[3], before.parameters.means[0])


def test_a_small_gaussian_is_cloned_and_the_clone_starts_without_moments():
    before = opaque(4, size=0.001)
    after = grow(before, [SMALL, LARGE, SMALL, LARGE])
    assert same_bits(rows_of(after, slice(4)), before)
    clones = rows_of(after, slice(4, None))
    for name, array in vars(clones.parameters).items():
        np.testing.assert_array_equal(array, getattr(before.parameters, name)[[1, 3]])
    assert not any(array.any() for part in (clones.first, clones.second) for array in vars(part).values())


def test_a_large_gaussian_is_split_into_two_smaller_ones():
    before = opaque(4, size=0.5)
    after = grow(before, [SMALL, LARGE, SMALL, LARGE])
    assert same_bits(rows_of(after, slice(2)), rows_of(before, [0, 2]))
    halves = rows_of(after, slice(2, None))
    parents = rows_of(before, [1, 3, 1, 3])
    np.testing.assert_allclose(
        np.exp(halves.parameters.log_scales), np.exp(parents.parameters.log_scales) / 1.6, rtol=1e-5
    )
    for name in ("quats", "opacity_logits", "sh_coeffs"):
        np.testing.assert_array_equal(getattr(halves.parameters, name), getattr(parents.parameters, name))
    assert not any(array.any() for part in (halves.first, halves.second) for array in vars(part).values())


def test_split_gaussians_are_sampled_from_their_parent():
    count = 20_000
    quat = np.array([0.7, -0.5, 0.9, 0.2])
    scales = np.array([0.5, 0.1, 0.03])
    parents = opaque(
        count,
        means=np.zeros((count, 3), np.float32) + np.float32(2),
        quats=np.tile(quat, (count, 1)).astype(np.float32),
        log_scales=np.tile(np.log(scales), (count, 1)).astype(np.float32),
    )
    drawn = grow(parents, np.full(count, LARGE)).parameters.means.astype(np.float64)
    assert len(drawn) == 2 * count
    rotation = rotation_from(quat)
    np.testing.assert_allclose(drawn.mean(axis=0), 2, atol=0.02)
    np.testing.assert_allclose(np.cov(drawn.T), rotation @ np.diag(scales**2) @ rotation.T, atol=0.005)


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 40), st.integers(0, 90), st.sampled_from([0.001, 0.02, 0.5]), st.integers(0, 9))
def test_growth_is_bounded_and_prefers_the_largest_gradients(count, bound, size, seed):
    before = opaque(count, size=size)
    gradients = np.random.default_rng(seed).permutation(np.linspace(0, 2 * LARGE, count))
    after = grow(before, gradients, max_gaussians=bound)
    wanted = int((gradients >= 2e-4).sum())
    grown = min(wanted, max(0, bound - count))
    assert len(after.parameters) == count + grown
    parents = np.argsort(-gradients)[:grown]
    others = np.setdiff1d(np.arange(count), parents)
    kept = {mean.tobytes() for mean in after.parameters.means}
    assert all(before.parameters.means[row].tobytes() in kept for row in others)


def test_a_reset_lowers_opacities_and_clears_only_their_moments():
    before = state(30)
    after = reset_opacities(before)
    old, new = (1 / (1 + np.exp(-s.parameters.opacity_logits.astype(float))) for s in (before, after))
    np.testing.assert_allclose(new, np.minimum(old, 0.01), rtol=1e-5)
    for part in ("first", "second"):
        assert not getattr(after, part).opacity_logits.any()
    for part in vars(before):
        for name in ("means", "quats", "log_scales", "sh_coeffs"):
            np.testing.assert_array_equal(getattr(getattr(after, part), name), getattr(getattr(before, part), name))
