"""Attacks: pure, seeded, behind one protocol."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest
from numpy.lib.recfunctions import append_fields

from gspure import plugins
from gspure.attacks import (
    Attack,
    Attacked,
    Measurements,
    attacks,
    compression,
    find_attack,
    learning,
    registry,
)
from gspure.errors import InputError
from gspure.model import Gaussians
from tests.attack_cases import changed, public

COUNT = 40
PRUNING = {
    *("unattacked", "gspure", "random_pruning", "lowest_weight", "lowest_opacity", "plain_weight", "plain_opacity"),
    *(
        "random_matched",
        "lowest_weight_matched",
        "lowest_opacity_matched",
        "crop",
        "gof",
        "opacity_weight",
        "gspure_scaled",
    ),
}
ELSEWHERE = (*compression.ATTACKS, *learning.ATTACKS)  # they need a package, or views
HERE = sorted(attack.name for attack in registry.BUILT_IN if attack not in ELSEWHERE)


def model(count: int = COUNT, seed: int = 0, extra: str | None = None) -> Gaussians:
    rng = np.random.default_rng(seed)
    vanilla = Gaussians.from_parameters(
        means=rng.normal(size=(count, 3)),
        quats=rng.normal(size=(count, 4)),
        scales=rng.uniform(0.01, 1, (count, 3)),
        opacities=rng.uniform(0.01, 0.99, count),
        sh_coeffs=rng.normal(size=(count, 4, 3)),
    )
    if extra is None:
        return vanilla
    further = rng.normal(size=(2, count)).astype(np.float32)
    return Gaussians(append_fields(vanilla.table, [f"{extra}{i}" for i in range(2)], further, usemask=False))


def measurements(count: int = COUNT) -> Measurements:
    rng = np.random.default_rng(1)
    weights = rng.lognormal(0, 2, count).astype(np.float32)
    opacities, distances = rng.uniform(size=(2, count)).astype(np.float32)
    labels = rng.permutation(np.arange(count, dtype=np.int32) % 4) - 1
    return Measurements(weights, weights < 1, opacities, 6 * distances, labels)


def test_built_in_attacks_are_found_by_name() -> None:
    assert {attack.name: attack for attack in registry.BUILT_IN}.items() <= attacks().items()


@pytest.mark.parametrize("name", HERE)
def test_same_seed_same_bytes(name: str) -> None:
    one, other = (find_attack(name).apply(model(), measurements(), seed=3) for _ in range(2))
    assert one.model.table.tobytes() == other.model.table.tobytes()
    assert one.model.comments == other.model.comments


@pytest.mark.parametrize("name", HERE)
def test_the_given_model_is_not_changed(name: str) -> None:
    given_model = model()
    before = given_model.table.tobytes()
    find_attack(name).apply(given_model, measurements())
    assert given_model.table.tobytes() == before


@pytest.mark.parametrize("name", sorted(PRUNING))
def test_rows_that_pruning_keeps_are_bit_identical_and_in_order(name: str) -> None:
    attacked = find_attack(name).apply(model(), measurements())
    assert attacked.model.table.tobytes() == model().table[~attacked.prune_mask].tobytes()
    np.testing.assert_array_equal(attacked.rows, np.flatnonzero(~attacked.prune_mask))


@pytest.mark.parametrize("name", sorted(set(HERE) - PRUNING))
def test_other_attacks_keep_every_row_and_change_something(name: str) -> None:
    attacked = find_attack(name).apply(model(), measurements())
    assert not attacked.prune_mask.any()
    assert attacked.model.table.tobytes() != model().table.tobytes()


def test_plain_weight_removes_what_lies_below_the_mean_over_tau() -> None:
    weights = np.array([1.0, 2.0, 9.0], np.float32)  # mean 4
    attacked = find_attack("plain_weight").apply(model(3), Measurements(weights), tau=2.5)
    assert attacked.prune_mask.tolist() == [True, False, False]


def test_feature_scaling_scales_colour_and_nothing_else() -> None:
    after = find_attack("feature_scaling").apply(model(), Measurements(), factor=1.5).model
    assert changed(model(), after) == {*(f"f_dc_{i}" for i in range(3)), *(f"f_rest_{i}" for i in range(9))}
    np.testing.assert_array_equal(after.sh_coeffs, model().sh_coeffs * np.float32(1.5))


def test_feature_scaling_of_opacity_scales_the_activated_one_and_stays_below_one() -> None:
    after = find_attack("feature_scaling").apply(model(), Measurements(), factor=2.0, attributes="opacity").model
    assert changed(model(), after) == {"opacity"}
    np.testing.assert_allclose(after.opacities, np.minimum(2 * model().opacities, 1), rtol=1e-5)
    assert np.isfinite(after.table["opacity"]).all()


@pytest.mark.parametrize("name", ["feature_scaling", "gaussian_noise"])
@pytest.mark.parametrize("extra", ["semantic_", "f_anchor_feat_"])
def test_attacks_on_colour_act_on_the_features_of_models_that_store_those(name: str, extra: str) -> None:
    before = model(extra=extra)
    assert changed(before, find_attack(name).apply(public(before), Measurements()).model) == {f"{extra}0", f"{extra}1"}


def test_gaussian_noise_has_the_given_deviation_and_is_independent() -> None:
    before = model(20_000)
    after = find_attack("gaussian_noise").apply(before, Measurements(), sigma=0.05).model
    noise = (after.sh_coeffs - before.sh_coeffs).reshape(20_000, -1)
    assert changed(before, after) == {*(f"f_dc_{i}" for i in range(3)), *(f"f_rest_{i}" for i in range(9))}
    np.testing.assert_allclose(noise.std(axis=0), 0.05, rtol=0.03)
    np.testing.assert_allclose(noise.mean(axis=0), 0, atol=0.002)
    np.testing.assert_allclose(np.corrcoef(noise.T), np.eye(12), atol=0.04)


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("random_pruning", {"fraction": 1.5}, "fraction: expected a number from 0 to 1, found 1.5"),
        ("random_pruning", {"ratio": 0.5}, "ratio: expected one of fraction"),
        ("unattacked", {"ratio": 0.5}, "ratio: expected no settings"),
        ("feature_scaling", {"factor": float("nan")}, "factor: expected a number from 0"),
        ("feature_scaling", {"attributes": "color"}, "attributes: expected one or more of colour,base_colour,opacity"),
        ("gaussian_noise", {"sigma": -1.0}, "sigma: expected a number from 0"),
        ("plain_weight", {"tau": 0.0}, "tau: expected a number above 0"),
        ("random_pruning", {"seed": -1}, "seed: expected a whole number from 0 .* found -1"),
    ],
)
def test_bad_settings_are_refused_in_one_line(name: str, settings: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        find_attack(name).apply(model(), measurements(), **settings)


@pytest.mark.parametrize("name", [name for name in HERE if find_attack(name).needs])
def test_missing_measurements_are_refused(name: str) -> None:
    needed = "|".join(find_attack(name).needs)
    with pytest.raises(InputError, match=f"attack {name}: ({needed}): expected .*, found nothing"):
        find_attack(name).apply(model(), Measurements())


def half(model: Gaussians, _rng: np.random.Generator, weights: np.ndarray, *, upper: int = 1) -> Attacked:
    return Attacked.without(model, (weights > np.median(weights)) != bool(upper))


HALF = Attack("half", half)
TAKEN = Attack("gspure", half)
GREEDY = Attack("greedy", lambda model, rng, key: Attacked.without(model, key))


def offer(monkeypatch: pytest.MonkeyPatch, target: str) -> None:
    entry = EntryPoint("theirs", f"{__name__}:{target}" if ":" not in target else target, registry.GROUP)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [entry] if group == registry.GROUP else [])


def test_a_plug_in_is_found_by_its_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    offer(monkeypatch, "HALF")
    attack = find_attack("half")
    assert attack.needs == {"weights"}
    assert attack.settings == {"upper": 1}
    assert len(attack.apply(model(), measurements()).model) == COUNT // 2


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("no_such_module:ATTACK", "expected an importable gspure.attacks.Attack, found ModuleNotFoundError"),
        ("MISSING", "expected an importable gspure.attacks.Attack, found AttributeError"),
        ("half", "expected an importable gspure.attacks.Attack, found function"),
        ("TAKEN", "name: expected a name not in use, found 'gspure'"),
        ("GREEDY", "needs: expected of cameras, columns, device, labels, opacities, .*, weights, found key"),
    ],
)
def test_a_bad_plug_in_is_named_in_one_line(monkeypatch: pytest.MonkeyPatch, target: str, message: str) -> None:
    offer(monkeypatch, target)
    with pytest.raises(InputError, match=r"unknown package \(entry point 'theirs' of gspure.attacks\): .*" + message):
        attacks()
