"""Attacks that remove rows: how many, which, and that nothing happens to the others."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.attacks import Measurements, find_attack
from tests.attack_cases import KINDS, measurements, unhurried
from tests.models import blobs

COUNT = 30
counts = st.integers(1, 40)
shares = st.floats(0, 1)
seeds = st.integers(0, 99)


@pytest.mark.parametrize("name", ["random_pruning", "lowest_weight", "lowest_opacity"])
@unhurried
@given(count=counts, fraction=shares, seed=seeds)
def test_exactly_the_fraction_is_removed(name: str, count: int, fraction: float, seed: int) -> None:
    attacked = find_attack(name).apply(blobs(count), measurements(count), seed=seed, fraction=fraction)
    assert attacked.prune_mask.sum() == count - len(attacked.model) == round(fraction * count)


@pytest.mark.parametrize(("name", "field"), [("lowest_weight", "weights"), ("lowest_opacity", "opacities")])
@unhurried
@given(count=counts, fraction=shares, seed=seeds)
def test_no_removed_row_is_above_a_kept_one(name: str, field: str, count: int, fraction: float, seed: int) -> None:
    found = measurements(count, seed)
    mask, values = find_attack(name).apply(blobs(count), found, fraction=fraction).prune_mask, getattr(found, field)
    assert values[mask].max(initial=-np.inf) <= values[~mask].min(initial=np.inf)


@pytest.mark.parametrize("name", ["random_matched", "lowest_weight_matched", "lowest_opacity_matched"])
@unhurried
@given(count=counts, seed=seeds)
def test_matched_controls_remove_as_many_as_gspure(name: str, count: int, seed: int) -> None:
    found = measurements(count, seed)
    assert find_attack(name).apply(blobs(count), found, seed=seed).prune_mask.sum() == found.prune_mask.sum()


@unhurried
@given(count=counts, seed=seeds, tau=st.floats(0.5, 8))
def test_opacity_and_weight_together_remove_what_either_does(count: int, seed: int, tau: float) -> None:
    masks = {
        name: find_attack(name).apply(blobs(count), measurements(count, seed), tau=tau).prune_mask
        for name in ("plain_opacity", "plain_weight", "opacity_weight")
    }
    assert (masks["opacity_weight"] == (masks["plain_opacity"] | masks["plain_weight"])).all()


@pytest.mark.parametrize("kind", KINDS)
@unhurried
@given(fraction=shares, seed=seeds)
def test_crop_keeps_a_box_and_a_larger_one_keeps_more(kind: str, fraction: float, seed: int) -> None:
    model = KINDS[kind](COUNT, seed)
    attacked = find_attack("crop").apply(model, Measurements(), fraction=fraction)
    larger = find_attack("crop").apply(model, Measurements(), fraction=min(1.0, fraction + 0.1))
    assert not larger.prune_mask[~attacked.prune_mask].any()
    assert attacked.model.table.tobytes() == model.table[~attacked.prune_mask].tobytes()
    if len(attacked.model):
        low, high = attacked.model.means.min(axis=0), attacked.model.means.max(axis=0)
        inside = ((model.means >= low) & (model.means <= high)).all(axis=1)
        np.testing.assert_array_equal(inside, ~attacked.prune_mask)
