"""What single attacks change: pruning, rows, values, motion, and what that affects of the message."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.attacks import Attacked, Measurements, find_attack
from gspure.attacks.attacked import affected
from gspure.attacks.geometry import radius
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.model.rotations import rotate_sh, sh_rotation
from tests.attack_cases import KINDS, anchors, changed, features, measurements, public, unhurried
from tests.models import blobs, camera, tilted_camera
from tests.reference.blending import render
from tests.reference.spherical_harmonics import sh_basis

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


COUNT_rows = 30
shares_rows = st.floats(0, 1)
seeds_rows = st.integers(0, 99)


def ordered(table: np.ndarray) -> list[bytes]:
    return sorted(row.tobytes() for row in table)


@pytest.mark.parametrize("kind", KINDS)
@unhurried
@given(seed=seeds_rows)
def test_reordering_is_a_permutation(kind: str, seed: int) -> None:
    model = KINDS[kind](COUNT_rows)
    attacked = find_attack("reorder").apply(model, Measurements(), seed=seed)
    assert not attacked.prune_mask.any()
    assert ordered(attacked.model.table) == ordered(model.table)
    assert attacked.model.table.tobytes() == model.table[attacked.rows].tobytes()


def test_reordering_leaves_images_as_they_are() -> None:
    attacked = find_attack("reorder").apply(blobs(COUNT_rows), Measurements())
    np.testing.assert_array_equal(image(attacked.model), image(blobs(COUNT_rows)))


@unhurried
@given(fraction=shares_rows, seed=seeds_rows)
def test_clones_are_their_originals_but_for_the_opacity_of_both(fraction: float, seed: int) -> None:
    model = blobs(COUNT_rows)
    attacked = find_attack("densify_clone").apply(model, Measurements(), seed=seed, fraction=fraction)
    number = round(fraction * COUNT_rows)
    assert len(attacked.model) == COUNT_rows + number
    np.testing.assert_array_equal(attacked.rows[:COUNT_rows], np.arange(COUNT_rows))
    assert changed(Gaussians(model.table[attacked.rows]), attacked.model) <= {"opacity"}
    times = np.bincount(attacked.rows)
    assert (times == 2).sum() == number
    once = times[attacked.rows] == 1
    np.testing.assert_array_equal(attacked.model.opacities[once], model.opacities[attacked.rows[once]])


@pytest.mark.parametrize("kind", KINDS)
@unhurried
@given(fraction=shares_rows, seed=seeds_rows)
def test_injected_rows_are_moved_copies_behind_the_untouched_ones(kind: str, fraction: float, seed: int) -> None:
    model = KINDS[kind](COUNT_rows)
    attacked = find_attack("inject").apply(model, Measurements(), seed=seed, fraction=fraction)
    assert len(attacked.model) == COUNT_rows + round(fraction * COUNT_rows)
    assert attacked.model.table[:COUNT_rows].tobytes() == model.table.tobytes()
    assert changed(Gaussians(model.table[attacked.rows]), attacked.model) <= {"x", "y", "z"}
    assert (attacked.model.means[COUNT_rows:] != model.means[attacked.rows[COUNT_rows:]]).any(axis=1).all()


def image(model: Gaussians) -> np.ndarray:
    return render(model, camera(), "ewa").channels


COUNT_values = 30
GEOMETRY = {"scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}
COLOURS = {
    "harmonics": {f"f_dc_{i}" for i in range(3)} | {f"f_rest_{i}" for i in range(45)},
    "features": {f"semantic_{i}" for i in range(3)},
    "anchors": {f"f_anchor_feat_{i}" for i in range(3)},
}
OWN = {
    "harmonics": {"opacity", *GEOMETRY},
    "features": {"opacity", *GEOMETRY},
    "anchors": {"scale_0", "scale_1", "scale_2"},
}


def attacked(name: str, model: Gaussians, seed: int = 0, **settings) -> Gaussians:
    return find_attack(name).apply(public(model), Measurements(), seed=seed, **settings).model


@pytest.mark.parametrize("kind", KINDS)
@unhurried
@given(bits=st.integers(1, 8), seed=st.integers(0, 99))
def test_quantized_values_are_off_by_at_most_half_a_step(kind: str, bits: int, seed: int) -> None:
    before = KINDS[kind](COUNT_values, seed)
    after = attacked("quantize", before, bits=bits)
    assert changed(before, after) <= COLOURS[kind] | OWN[kind]
    for name in COLOURS[kind] | OWN[kind]:
        old, new = before.table[name].astype(float), after.table[name].astype(float)
        step = np.ptp(old) / (2**bits - 1)
        assert np.abs(new - old).max() <= step / 2 + 1e-6 * np.abs(old).max()
        assert len(np.unique(new)) <= 2**bits
        assert (new.min(), new.max()) == (old.min(), old.max())


def test_half_precision_is_that_of_ieee_and_does_not_overflow() -> None:
    before = blobs(COUNT_values).with_columns({"f_dc_0": np.linspace(-1e6, 1e6, COUNT_values)})
    after = attacked("quantize", before, bits=16)
    assert np.abs(after.table["f_dc_0"]).max() == 65504
    np.testing.assert_allclose(after.table["opacity"], before.table["opacity"], rtol=2**-11)
    np.testing.assert_array_equal(after.means, before.means)


@unhurried
@given(degree=st.integers(0, 2), stored=st.integers(1, 3))
def test_truncation_zeroes_the_harmonics_above_the_degree_and_no_others(degree: int, stored: int) -> None:
    before = blobs(COUNT_values, sh_degree=stored)
    if degree >= stored:
        with pytest.raises(InputError, match=f"not applicable: no harmonics above degree {degree}"):
            attacked("sh_truncation", before, degree=degree)
        return
    after, left = attacked("sh_truncation", before, degree=degree), (degree + 1) ** 2
    np.testing.assert_array_equal(after.sh_coeffs[:, :left], before.sh_coeffs[:, :left])
    assert not after.sh_coeffs[:, left:].any()
    assert {name.rpartition("_")[0] for name in changed(before, after)} == {"f_rest"}


def test_opacity_noise_is_relative_and_has_the_given_deviation() -> None:
    before = blobs(20_000)
    after = attacked("opacity_noise", before, sigma=0.05)
    assert changed(before, after) == {"opacity"}
    middle = (before.opacities > 0.01) & (before.opacities < 0.7)  # nothing of these is clipped
    np.testing.assert_allclose((after.opacities / before.opacities)[middle].std(), 0.05, rtol=0.05)
    assert np.isfinite(after.table["opacity"]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_position_noise_is_in_radii_and_moves_centres_only(kind: str) -> None:
    before = KINDS[kind](5000)
    after = attacked("position_noise", before, sigma=0.01)
    assert changed(before, after) == {"x", "y", "z"}
    np.testing.assert_allclose((after.means - before.means).std(axis=0), 0.01 * radius(before), rtol=0.05)


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("opacity_noise", {}),
        ("densify_clone", {}),
        ("feature_scaling", {"attributes": "opacity"}),
        ("gaussian_noise", {"attributes": "opacity"}),
        ("quantize", {"attributes": "opacity,rotation"}),
    ],
)
def test_attacks_on_missing_attributes_refuse_anchors(name: str, settings: dict) -> None:
    with pytest.raises(InputError, match="not applicable: rows do not store"):
        attacked(name, anchors(COUNT_values), **settings)
    attacked(name, features(COUNT_values), **settings)


COUNT_motion = 20
angles = st.floats(-400, 400)
vectors = st.tuples(*[st.floats(-3, 3)] * 3)
axes = vectors.filter(lambda axis: np.linalg.norm(axis) > 0.1)
degrees = st.integers(0, 3)


def moved(model: Gaussians, angle: float, axis=(0, 1, 0), translation=(0, 0, 0)):
    texts = {"axis": ",".join(map(str, axis)), "translation": ",".join(map(str, translation))}
    return find_attack("rigid_transform").apply(public(model), Measurements(), angle=angle, **texts)


@unhurried
@given(degree=st.integers(1, 3), axis=axes, angle=angles, seed=st.integers(0, 99))
def test_turned_harmonics_are_those_seen_from_turned_directions(degree, axis, angle, seed) -> None:
    unit, radians = np.array(axis) / np.linalg.norm(axis), np.deg2rad(angle)
    rotation = moved(blobs(1), angle, axis).transform[:3, :3]
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(10, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    coeffs = rng.normal(size=(1, (degree + 1) ** 2, 3))
    before = sh_basis(directions)[:, : coeffs.shape[1]] @ coeffs[0]
    after = sh_basis(directions @ rotation.T)[:, : coeffs.shape[1]] @ rotate_sh(coeffs, radians * unit)[0]
    np.testing.assert_allclose(after, before, atol=1e-10)


@unhurried
@given(degree=degrees, axis=axes, one=angles, other=angles)
def test_matrices_of_harmonics_are_orthogonal_and_turns_add_up(degree, axis, one, other) -> None:
    unit, (one, other) = np.array(axis) / np.linalg.norm(axis), np.deg2rad([one, other])
    first, second = (sh_rotation(degree, radians * unit) for radians in (one, other))
    np.testing.assert_allclose(first @ first.T, np.eye(2 * degree + 1), atol=1e-12)
    np.testing.assert_allclose(second @ first, sh_rotation(degree, (one + other) * unit), atol=1e-12)


@pytest.mark.parametrize("view", [camera(), tilted_camera()], ids=["straight", "tilted"])
def test_images_are_the_same_from_moved_views_and_others_from_the_old_ones(view) -> None:
    before = blobs(COUNT_motion)
    attacked = moved(before, 70.0, (1, 2, -1), (0.5, 0, -1))
    truth = render(before, view, "ewa").channels
    assert np.abs(render(attacked.model, view.moved(attacked.transform), "ewa").channels - truth).mean() < 1e-4
    assert np.abs(render(attacked.model, view, "ewa").channels - truth).mean() > 1e-2


COUNT_affected = 30
BITS = ("f_dc_*", "f_rest_*", "opacity")  # Splats in Splats, read from the public colours
PLACES = ("x", "y", "z")  # the same, with the owner's own colours and opacities
BLEND = ("semantic_*", "x", "y", "z", "opacity", "scale_*", "rot_*")  # GS-Hider
FEATURES = ("f_anchor_feat_*",)  # SecureGS


def affects(name: str, model: Gaussians, reads: tuple[str, ...], **settings) -> bool:
    return affected(model, find_attack(name).apply(public(model), measurements(COUNT_affected), **settings), reads)


@pytest.mark.parametrize(
    ("name", "settings", "bits", "places"),
    [
        ("unattacked", {}, False, False),
        ("feature_scaling", {}, True, False),
        ("feature_scaling", {"factor": 1.0}, False, False),
        ("gaussian_noise", {}, True, False),
        ("gaussian_noise", {"sigma": 0.0}, False, False),
        ("gaussian_noise", {"attributes": "opacity"}, True, False),
        ("quantize", {}, True, False),
        ("sh_truncation", {"degree": 2}, True, False),
        ("position_noise", {}, False, True),
        ("random_pruning", {"fraction": 0.1}, True, True),
        ("random_pruning", {"fraction": 0.0}, False, False),
        ("reorder", {}, False, False),
        ("inject", {}, False, True),
        ("densify_clone", {}, True, False),
    ],
)
def test_an_attack_affects_what_it_changes_or_loses(name: str, settings: dict, bits: bool, places: bool) -> None:
    assert affects(name, blobs(COUNT_affected), BITS, **settings) == bits
    assert affects(name, blobs(COUNT_affected), PLACES, **settings) == places


def test_where_all_rows_are_blended_further_ones_affect_the_message() -> None:
    assert affects("inject", features(COUNT_affected), BLEND)
    assert not affects("inject", anchors(COUNT_affected), FEATURES)
    assert not affects("reorder", features(COUNT_affected), BLEND)


def test_a_removed_row_affects_the_message_whatever_it_reads() -> None:
    model = blobs(COUNT_affected)
    assert affected(model, Attacked.without(model, np.arange(COUNT_affected) == 0), ())
