"""Attacks that add rows or change their order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.attacks import Measurements, find_attack
from gspure.model import Gaussians
from tests.attack_cases import KINDS, changed, unhurried
from tests.models import blobs, camera
from tests.reference.blending import render

COUNT = 30
shares = st.floats(0, 1)
seeds = st.integers(0, 99)


def ordered(table: np.ndarray) -> list[bytes]:
    return sorted(row.tobytes() for row in table)


@pytest.mark.parametrize("kind", KINDS)
@unhurried
@given(seed=seeds)
def test_reordering_is_a_permutation(kind: str, seed: int) -> None:
    model = KINDS[kind](COUNT)
    attacked = find_attack("reorder").apply(model, Measurements(), seed=seed)
    assert not attacked.prune_mask.any()
    assert ordered(attacked.model.table) == ordered(model.table)
    assert attacked.model.table.tobytes() == model.table[attacked.rows].tobytes()


def test_reordering_leaves_images_as_they_are() -> None:
    attacked = find_attack("reorder").apply(blobs(COUNT), Measurements())
    np.testing.assert_array_equal(image(attacked.model), image(blobs(COUNT)))


@unhurried
@given(fraction=shares, seed=seeds)
def test_clones_are_their_originals_but_for_the_opacity_of_both(fraction: float, seed: int) -> None:
    model = blobs(COUNT)
    attacked = find_attack("densify_clone").apply(model, Measurements(), seed=seed, fraction=fraction)
    number = round(fraction * COUNT)
    assert len(attacked.model) == COUNT + number
    np.testing.assert_array_equal(attacked.rows[:COUNT], np.arange(COUNT))
    assert changed(Gaussians(model.table[attacked.rows]), attacked.model) <= {"opacity"}
    times = np.bincount(attacked.rows)
    assert (times == 2).sum() == number
    once = times[attacked.rows] == 1
    np.testing.assert_array_equal(attacked.model.opacities[once], model.opacities[attacked.rows[once]])


@pytest.mark.parametrize("kind", KINDS)
@unhurried
@given(fraction=shares, seed=seeds)
def test_injected_rows_are_moved_copies_behind_the_untouched_ones(kind: str, fraction: float, seed: int) -> None:
    model = KINDS[kind](COUNT)
    attacked = find_attack("inject").apply(model, Measurements(), seed=seed, fraction=fraction)
    assert len(attacked.model) == COUNT + round(fraction * COUNT)
    assert attacked.model.table[:COUNT].tobytes() == model.table.tobytes()
    assert changed(Gaussians(model.table[attacked.rows]), attacked.model) <= {"x", "y", "z"}
    assert (attacked.model.means[COUNT:] != model.means[attacked.rows[COUNT:]]).any(axis=1).all()


def image(model: Gaussians) -> np.ndarray:
    return render(model, camera(), "ewa").channels
