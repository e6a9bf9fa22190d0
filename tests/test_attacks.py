"""Every attack of the registry: pure, seeded, behind one protocol; what it changes and affects; and plug-ins."""

import inspect
from importlib.metadata import EntryPoint

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure import Plugin, plugins
from gspure.attacks import (
    BUILT_IN,
    Attack,
    Attacked,
    Measurements,
    NotApplicable,
    affected,
    attacks,
    collusion,
    compression,
    find_attack,
    learning,
    pruning,
    renders,
)
from gspure.attacks.geometry import radius
from gspure.constants import SH_DC
from gspure.errors import InputError
from gspure.model import Gaussians, write_model
from tests.attack_cases import KINDS, anchors, apply, changed, features, measurements, unhurried
from tests.models import blobs, camera, covariances, gaussians
from tests.reference.blending import render

COUNT = 30
ELSEWHERE = (*compression.ATTACKS, *learning.ATTACKS, *collusion.ATTACKS, *renders.ATTACKS)  # need or act on more
HERE = [attack for attack in BUILT_IN if attack not in ELSEWHERE]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("attack", HERE, ids=lambda attack: attack.name)
def test_an_attack_is_pure_seeded_and_removes_or_changes_rows(attack: Attack, kind: str) -> None:
    model = KINDS[kind](COUNT)
    before = model.table.tobytes()
    try:
        attacked, again, other_seed = (apply(attack.name, model, seed) for seed in (3, 3, 4))
    except NotApplicable:
        assert kind != "harmonics"
        return
    assert model.table.tobytes() == before
    after = attacked.model.table.tobytes()
    assert after == again.model.table.tobytes()
    assert attacked.model.comments == again.model.comments
    kept = model.table[~attacked.prune_mask].tobytes()
    if attack in pruning.ATTACKS:
        assert after == kept
        np.testing.assert_array_equal(attacked.rows, np.flatnonzero(~attacked.prune_mask))
    else:
        assert after != kept or attacked.prune_mask.any()
    is_random = "rng" in inspect.signature(attack.function).parameters  # else `_rng`
    assert (after != other_seed.model.table.tobytes()) == is_random


@pytest.mark.parametrize("attack", renders.ATTACKS, ids=lambda attack: attack.name)
def test_an_attack_on_renders_is_pure_seeded_by_view_and_leaves_the_model(attack: Attack) -> None:
    model = blobs(COUNT)
    image = np.random.default_rng(0).random((12, 16, 3), np.float32)
    before = image.tobytes()
    attacked = attack.apply(model, seed=3)
    assert attacked.model is model
    retouched = attacked.retouched(image, "a")
    assert image.tobytes() == before
    assert retouched.tobytes() != before
    assert retouched.tobytes() == attacked.retouched(image, "a").tobytes()
    assert retouched.shape == image.shape
    assert retouched.dtype == np.float32
    is_random = attack.name in ("pixel_noise", "resized_crop")
    of_other_view = attacked.retouched(image, "b")
    of_other_seed = attack.apply(model, seed=4).retouched(image, "a")
    assert (retouched.tobytes() != of_other_view.tobytes()) == is_random
    assert (retouched.tobytes() != of_other_seed.tobytes()) == is_random


def test_image_attacks_do_what_they_say() -> None:
    rng = np.random.default_rng(0)
    grey = np.full((64, 64, 3), 0.25, np.float32)
    step = np.repeat(np.linspace(0, 1, 2, dtype=np.float32), 32)[None, :, None] * np.ones((64, 1, 3), np.float32)
    assert renders.brightness(grey, rng, factor=2.0) == pytest.approx(0.5)
    assert renders.pixel_noise(grey, rng, sigma=0.1).std() == pytest.approx(0.1, rel=0.05)
    slope = np.diff(renders.blur(step, rng, radius=3.0)[32, :, 0].astype(np.float64))
    places = np.arange(len(slope))
    mean = slope @ places / slope.sum()
    variance = slope @ (places - mean) ** 2 / slope.sum()
    assert np.sqrt(variance) == pytest.approx(3.0, rel=0.1)
    ramp = np.linspace(0, 1, 64, dtype=np.float32)[None, :, None] * np.ones((64, 1, 3), np.float32)
    assert np.ptp(renders.resized_crop(ramp, rng, area=0.25)) == pytest.approx(0.5, abs=0.03)
    dot = np.where(np.indices((9, 9)).sum(axis=0)[..., None] == 0, np.float32(1), grey[:9, :9])
    assert renders.median(dot, rng, radius=1) == pytest.approx(0.25, abs=1 / 255)
    assert renders.resize(ramp, rng, scale=0.5) == pytest.approx(ramp, abs=0.03)
    assert renders.resize(np.indices((64, 64, 3)).sum(0) % 2, rng, scale=0.25).std() < 0.05


@pytest.mark.parametrize("attack", [attack for attack in HERE if attack.needs], ids=lambda attack: attack.name)
def test_missing_measurements_are_refused_with_the_command_that_writes_them(attack: Attack) -> None:
    refusal = f"attack {attack.name}: ({'|'.join(attack.needs)}): .*, found nothing .run `gspure (purify|audit) MODEL"
    with pytest.raises(InputError, match=refusal):
        attack.apply(blobs(COUNT), Measurements())


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("random_pruning", {"fraction": 1.5}, "fraction: expected a number from 0 to 1, found 1.5"),
        ("random_pruning", {"ratio": 0.5}, "ratio: expected one of fraction"),
        ("feature_scaling", {"attributes": "color"}, "attributes: expected one or more of colour,base_colour,opacity"),
        ("quantize", {"bits": 9}, "bits: expected 1 to 8, or 16"),
        ("rigid_transform", {"axis": "0,0,0"}, "axis: expected an axis"),
        ("rigid_transform", {"translation": "1,x,2"}, "translation: expected three numbers"),
        ("finetune", {"render": "sepia:1"}, "attack: expected one of jpeg"),
        ("distil", {"render": "jpeg:0"}, "quality: expected a whole number from 1 to 100, found '0'"),
        ("collusion", {"rule": "most"}, "rule: expected one of mean"),
        ("random_pruning", {"seed": -1}, "seed: expected a whole number from 0 .* found -1"),
    ],
)
def test_bad_settings_are_refused(name: str, settings: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        apply(name, blobs(COUNT), **settings)


def half(model, _rng, weights, *, upper: int = 1) -> Attacked:
    return Attacked.without(model, (weights > np.median(weights)) != bool(upper))


OTHER = Plugin(attacks=[half])
TAKEN = Plugin(attacks=[Attack("gspure", half)])
GREEDY = Plugin(attacks=[Attack("greedy", lambda model, rng, key: Attacked.without(model, key))])


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("MISSING", "expected an importable gspure.Plugin, found AttributeError"),
        ("half", "expected an importable gspure.Plugin, found function"),
        ("OTHER", "attacks: expected objects of Attack, found function"),
        ("TAKEN", "name: expected a name not in use, found 'gspure'"),
        ("GREEDY", "needs: expected none but columns, labels, opacities, .*, weights, found key"),
    ],
)
def test_a_bad_plug_in_is_named(monkeypatch: pytest.MonkeyPatch, target: str, message: str) -> None:
    monkeypatch.setattr(plugins, "_entries", lambda _: [EntryPoint("theirs", f"{__name__}:{target}", plugins.GROUP)])
    with pytest.raises(InputError, match=r"\(entry point 'theirs' of gspure\): .*" + message):
        attacks()


def test_what_a_plug_in_returns_is_checked() -> None:
    with pytest.raises(InputError, match="rows: expected"):
        Attack("faulty", lambda model, _rng: Attacked(model, np.arange(3), len(model))).apply(blobs(COUNT))


counts = st.integers(1, 40)
shares = st.floats(0, 1)
seeds = st.integers(0, 99)

GEOMETRY = {*(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))}
COLOURS = {
    "harmonics": {*(f"f_dc_{i}" for i in range(3)), *(f"f_rest_{i}" for i in range(45))},
    "features": {f"semantic_{i}" for i in range(3)},
    "anchors": {f"f_anchor_feat_{i}" for i in range(3)},
}


def image(model: Gaussians) -> np.ndarray:
    return render(model, camera(), "ewa").channels


@unhurried
@given(count=counts, fraction=shares, seed=seeds)
def test_exactly_the_fraction_of_lowest_or_random_rows_is_removed(count: int, fraction: float, seed: int) -> None:
    known = measurements(count)
    number = round(fraction * count)
    for name, values in (
        ("random_pruning", None),
        ("lowest_weight", known.weights),
        ("lowest_opacity", known.opacities),
    ):
        mask = apply(name, blobs(count), seed, fraction=fraction).prune_mask
        assert mask.sum() == number
        if values is not None:
            assert values[mask].max(initial=-np.inf) <= values[~mask].min(initial=np.inf)
    for name in ("random_matched", "lowest_weight_matched", "lowest_opacity_matched"):
        assert apply(name, blobs(count), seed).prune_mask.sum() == known.prune_mask.sum()


def test_rows_that_no_view_shows_are_removed() -> None:
    opacity = np.array([1 / 256, 1 / 254, 0.5])
    model = blobs(3).with_columns({"opacity": np.log(opacity / (1 - opacity)).astype(np.float32)})
    attacked = find_attack("transparent").apply(model, Measurements(opacities=model.opacities))
    assert attacked.prune_mask.tolist() == [True, False, False]


@unhurried
@given(count=st.integers(2, 40), share=st.floats(1e-6, 0.9))
def test_the_rows_of_lowest_weight_are_removed_up_to_the_share(count: int, share: float) -> None:
    weights = measurements(count).weights
    mask = apply("weight_share", blobs(count), share=share).prune_mask
    assert weights[mask].sum() <= share * weights.sum() * (1 + 1e-6)
    assert weights[mask].sum() + weights[~mask].min() > share * weights.sum() * (1 - 1e-6)


@unhurried
@given(count=counts, tau=st.floats(0.5, 8))
def test_opacity_and_weight_together_remove_what_either_does(count: int, tau: float) -> None:
    opacity, weight, both = (
        apply(name, blobs(count), tau=tau).prune_mask for name in ("plain_opacity", "plain_weight", "opacity_weight")
    )
    np.testing.assert_array_equal(both, opacity | weight)


@unhurried
@given(fraction=shares, seed=seeds)
def test_crop_keeps_a_box_and_a_larger_one_keeps_more(fraction: float, seed: int) -> None:
    model = blobs(COUNT, seed)
    attacked = apply("crop", model, fraction=fraction)
    larger = apply("crop", model, fraction=min(1.0, fraction + 0.1))
    assert not larger.prune_mask[~attacked.prune_mask].any()
    if len(attacked.model):
        low = attacked.model.means.min(axis=0)
        high = attacked.model.means.max(axis=0)
        inside = ((model.means >= low) & (model.means <= high)).all(axis=1)
        np.testing.assert_array_equal(inside, ~attacked.prune_mask)


@pytest.mark.parametrize("kind", KINDS)
def test_reordering_is_a_permutation_that_no_image_shows(kind: str) -> None:
    model = KINDS[kind](COUNT)
    attacked = apply("reorder", model)
    assert sorted(attacked.rows) == list(range(COUNT))
    assert attacked.model.table.tobytes() == model.table[attacked.rows].tobytes()
    if kind == "harmonics":
        np.testing.assert_array_equal(image(attacked.model), image(model))


@unhurried
@given(fraction=shares, seed=seeds)
def test_clones_are_their_originals_but_for_the_opacity_of_both(fraction: float, seed: int) -> None:
    model = blobs(COUNT)
    number = round(fraction * COUNT)
    attacked = apply("densify_clone", model, seed, fraction=fraction)
    np.testing.assert_array_equal(attacked.rows[:COUNT], np.arange(COUNT))
    originals = Gaussians(model.table[attacked.rows])
    assert changed(originals, attacked.model) <= {"opacity"}
    times = np.bincount(attacked.rows)
    assert (times == 2).sum() == number == len(attacked.model) - COUNT
    transmitted = (1 - attacked.model.opacities.astype(np.float64)) ** times[attacked.rows]
    np.testing.assert_allclose(transmitted, 1 - originals.opacities.astype(np.float64), atol=2e-6)


@pytest.mark.parametrize("kind", KINDS)
@unhurried
@given(fraction=shares, seed=seeds)
def test_injected_rows_are_moved_copies_behind_the_untouched_ones(kind: str, fraction: float, seed: int) -> None:
    model = KINDS[kind](COUNT)
    attacked = apply("inject", model, seed, fraction=fraction)
    assert len(attacked.model) == COUNT + round(fraction * COUNT)
    assert attacked.model.table[:COUNT].tobytes() == model.table.tobytes()
    assert changed(Gaussians(model.table[attacked.rows]), attacked.model) <= {"x", "y", "z"}
    assert (attacked.model.means[COUNT:] != model.means[attacked.rows[COUNT:]]).any(axis=1).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_merged_scene_lies_beside_the_untouched_rows_and_has_other_centres(kind: str) -> None:
    model = KINDS[kind](COUNT)
    attacked = apply("merge", model, distance=2.0)
    assert attacked.model.table[:COUNT].tobytes() == model.table.tobytes()
    shift = attacked.model.means[COUNT:] - model.means
    np.testing.assert_allclose(shift, np.tile([2 * radius(model), 0, 0], (COUNT, 1)), atol=1e-4)
    assert sorted(attacked.rows[COUNT:]) == list(range(COUNT)) != attacked.rows[COUNT:].tolist()


def test_halves_have_the_moments_and_the_area_of_a_row_and_merge_into_it_again() -> None:
    means = np.stack([*np.meshgrid([-2.0, 0.0, 2.0], [-1.5, 1.5]), np.full((2, 3), 8.0)], axis=2).reshape(-1, 3)
    quats = np.random.default_rng(0).normal(size=(6, 4)) * [1, 0, 0, 1]  # about the line of sight
    model = gaussians(means=means, scales=[0.5, 0.2, 0.1], quats=quats, opacities=np.linspace(0.1, 0.99, 6))
    halves = apply("split", model, fraction=1.0)
    assert halves.rows.tolist() == [*range(6), *range(6)]
    first, second = halves.model[:6], halves.model[6:]
    assert (np.linalg.norm(first.means - second.means, axis=1) > 0.4).all()
    np.testing.assert_allclose((first.means + second.means) / 2, model.means, atol=1e-6)
    assert image(halves.model).sum() == pytest.approx(image(model).sum(), rel=0.01)
    merged = apply("merge_pairs", halves.model, fraction=0.5).model
    np.testing.assert_allclose(merged.means, model.means, atol=1e-5)
    np.testing.assert_allclose(covariances(merged), covariances(model), atol=1e-5)
    assert image(merged).sum() == pytest.approx(image(model).sum(), rel=0.1)


@pytest.mark.parametrize("amplitude", [0.001, 0.01])
def test_a_warp_moves_centres_smoothly_by_at_most_its_amplitude(amplitude: float) -> None:
    model = blobs(200)
    neighbours = model.with_columns({"x": model.table["x"] + np.float32(0.01 * radius(model))})
    both = Gaussians(np.concatenate([model.table, neighbours.table]))
    shifts = (apply("warp", both, amplitude=amplitude).model.means - both.means) / radius(both)
    lengths = np.linalg.norm(shifts, axis=1)
    assert amplitude / 10 < lengths.max() <= amplitude * (1 + 1e-3)
    assert np.abs(shifts[:200] - shifts[200:]).max() < 2 * np.pi * 0.01 * amplitude + 1e-6


@pytest.mark.parametrize(
    ("rule", "expected"), [("mean", [1, 2, 4]), ("majority", [0, 0, 3]), ("interleave", [[0, 3], [0, 6], [3, 6]])]
)
def test_copies_are_mixed_number_by_number_or_row_by_row(rule: str, expected: list, tmp_path) -> None:
    model = blobs(COUNT)
    marks = [[0, 0, 3], [0, 0, 3], [3, 6, 6]]
    copies = [model.with_columns({f"f_dc_{i}": np.full(COUNT, value) for i, value in enumerate(m)}) for m in marks]
    for number, copy in enumerate(copies[1:]):
        write_model(tmp_path / f"{number}.ply", copy)
    mixed = apply("collusion", copies[0], copies=str(tmp_path), rule=rule).model
    for channel, values in enumerate(expected):
        assert {*mixed.table[f"f_dc_{channel}"].tolist()} == {*np.atleast_1d(values).tolist()}
    assert changed(model, mixed) <= {"f_dc_0", "f_dc_1", "f_dc_2"}
    with pytest.raises(InputError, match="copy: expected 5 rows"):
        apply("collusion", model[:5], copies=str(tmp_path))


@pytest.mark.parametrize("kind", KINDS)
def test_attacks_on_colour_change_harmonics_or_features_alone(kind: str) -> None:
    before = KINDS[kind](COUNT)
    for name in ("feature_scaling", "gaussian_noise"):
        assert changed(before, apply(name, before).model) == COLOURS[kind]
    scaled = apply("feature_scaling", before, factor=1.5).model
    for name in COLOURS[kind]:
        np.testing.assert_array_equal(scaled.table[name], before.table[name] * np.float32(1.5))


def test_noise_has_the_given_deviation_and_is_independent() -> None:
    before = blobs(20_000, sh_degree=1)
    noise = (apply("gaussian_noise", before, sigma=0.05).model.sh_coeffs - before.sh_coeffs).reshape(20_000, -1)
    np.testing.assert_allclose(np.cov(noise.T), 0.05**2 * np.eye(12), atol=0.04 * 0.05**2)
    edited = apply("sh_edit", before, sigma=0.05, factor=0.5).model.sh_coeffs
    np.testing.assert_array_equal(edited[:, 0], before.sh_coeffs[:, 0])
    np.testing.assert_allclose((edited - before.sh_coeffs / 2)[:, 1:].std(axis=0), 0.05, rtol=0.05)
    after = apply("opacity_noise", before, sigma=0.05).model
    assert changed(before, after) == {"opacity"}
    middle = (before.opacities > 0.01) & (before.opacities < 0.7)  # nothing of these is clipped
    np.testing.assert_allclose((after.opacities / before.opacities)[middle].std(), 0.05, rtol=0.05)
    after = apply("position_noise", before, sigma=0.01).model
    assert changed(before, after) == {"x", "y", "z"}
    np.testing.assert_allclose((after.means - before.means).std(axis=0), 0.01 * radius(before), rtol=0.05)


@pytest.mark.parametrize("kind", KINDS)
@unhurried
@given(bits=st.integers(1, 8), seed=seeds)
def test_quantized_values_are_off_by_at_most_half_a_step(kind: str, bits: int, seed: int) -> None:
    before = KINDS[kind](COUNT, seed)
    after = apply("quantize", before, bits=bits).model
    rest = {"scale_0", "scale_1", "scale_2"} if kind == "anchors" else {"opacity", *GEOMETRY}
    assert changed(before, after) <= COLOURS[kind] | rest
    for name in COLOURS[kind] | rest:
        old = before.table[name].astype(float)
        new = after.table[name].astype(float)
        step = np.ptp(old) / (2**bits - 1)
        assert np.abs(new - old).max() <= step / 2 + 1e-6 * np.abs(old).max()
        assert len(np.unique(new)) <= 2**bits
        assert (new.min(), new.max()) == (old.min(), old.max())


def test_half_precision_is_that_of_ieee_and_does_not_overflow() -> None:
    before = blobs(COUNT).with_columns({"f_dc_0": np.linspace(-1e6, 1e6, COUNT)})
    after = apply("quantize", before, bits=16).model
    assert np.abs(after.table["f_dc_0"]).max() == 65504
    np.testing.assert_array_equal(after.table["opacity"], before.table["opacity"].astype(np.float16))


@pytest.mark.parametrize("degree", range(3))
@pytest.mark.parametrize("stored", range(1, 4))
def test_truncation_zeroes_the_harmonics_above_the_degree_and_no_others(degree: int, stored: int) -> None:
    before = blobs(COUNT, sh_degree=stored)
    if degree >= stored:
        with pytest.raises(NotApplicable, match=f"no harmonics above degree {degree}"):
            apply("sh_truncation", before, degree=degree)
        return
    after = apply("sh_truncation", before, degree=degree).model
    left = (degree + 1) ** 2
    np.testing.assert_array_equal(after.sh_coeffs[:, :left], before.sh_coeffs[:, :left])
    assert not after.sh_coeffs[:, left:].any()
    assert {name.rpartition("_")[0] for name in changed(before, after)} == {"f_rest"}


CODECS = {"compressed_ply": 1 / 255, "spz": 1 / 127, "splat": 1 / 255, "ksplat": 1 / 255, "sog": 0.1}


@pytest.mark.parametrize(("codec", "colour"), CODECS.items())
def test_rows_come_back_nearly_as_they_were_and_the_same_way_each_time(codec: str, colour: float) -> None:
    pytest.importorskip("gsply", reason="gspure[compression] is not installed")
    pytest.importorskip("gaussforge", reason="gspure[compression] is not installed")
    before = blobs(300, sh_degree=2)
    before = before.with_columns(
        {name: np.clip(before.table[name], -1, 1) for name in before.names if name[:2] == "f_"}
    )
    attacked = apply("compression", before, codec=codec)
    assert sorted(attacked.rows.tolist()) == list(range(300))
    origin = Gaussians(before.table[attacked.rows])
    after = attacked.model
    np.testing.assert_allclose(after.means, origin.means, atol=np.ptp(before.means, axis=0).max() / 1000)
    np.testing.assert_allclose(after.opacities, origin.opacities, atol=1 / 255)
    np.testing.assert_allclose(after.sh_coeffs[:, 0], origin.sh_coeffs[:, 0], atol=colour / SH_DC)
    assert (after.sh_coeffs[:, 1:] == 0).all() == (codec == "splat")
    assert after.table.tobytes() == apply("compression", before, codec=codec).model.table.tobytes()


BITS = ("f_dc_*", "f_rest_*", "opacity")  # Splats in Splats, read from the public colours
PLACES = ("x", "y", "z")  # the same, with the owner's own colours and opacities
BLEND = ("semantic_*", "x", "y", "z", "opacity", "scale_*", "rot_*")  # GS-Hider
FEATURES = ("f_anchor_feat_*",)  # SecureGS


@pytest.mark.parametrize(
    ("name", "settings", "bits", "places"),
    [
        ("gaussian_noise", {}, True, False),
        ("position_noise", {}, False, True),
        ("random_pruning", {"fraction": 0.1}, True, True),
        ("reorder", {}, False, False),
        ("inject", {}, False, True),
    ],
)
def test_an_attack_affects_what_it_changes_or_loses(name: str, settings: dict, bits: bool, places: bool) -> None:
    model = blobs(COUNT)
    attacked = apply(name, model, **settings)
    assert (affected(model, attacked, BITS), affected(model, attacked, PLACES)) == (bits, places)


def test_added_and_removed_rows_affect_what_blends_all_rows() -> None:
    for model, reads, blends in ((features(COUNT), BLEND, True), (anchors(COUNT), FEATURES, False)):
        assert affected(model, apply("inject", model), reads) == blends
    assert affected(model, Attacked.without(model, np.arange(COUNT) == 0), ())
