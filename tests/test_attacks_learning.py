"""Attacks that learn from the public model's own renders: what they are given, change and keep."""

import numpy as np
import pytest

from gspure.attacks import Attacked, Measurements, find_attack
from gspure.attacks.learning import ATTACKS
from gspure.attacks.strength import scene_damage
from gspure.method.pruning import plain_prune_mask
from gspure.public_model import PublicModel
from tests.attack_cases import changed
from tests.models import blobs, camera, tilted_camera

VIEWS = [camera(name="a"), tilted_camera(name="b")]
ROWS = 80
WEIGHTS = np.random.default_rng(0).lognormal(0, 1, ROWS).astype(np.float32)
LABELS = np.arange(ROWS, dtype=np.int32) % 4 - 1
NAMES = [attack.name for attack in ATTACKS]
GEOMETRY = {"x", "y", "z", *(f"rot_{i}" for i in range(4)), *(f"scale_{i}" for i in range(3))}


def attacked_by(name: str, seed: int = 0, **settings) -> Attacked:
    measurements = Measurements(WEIGHTS, labels=LABELS) if find_attack(name).needs else Measurements()
    settings = {"iterations": 6, **settings}
    return find_attack(name).apply(PublicModel(blobs(ROWS)), measurements, seed=seed, cameras=VIEWS, **settings)


@pytest.mark.parametrize("name", NAMES)
def test_the_same_arguments_give_the_same_bytes_and_change_the_model(name: str) -> None:
    one, other = attacked_by(name), attacked_by(name)
    assert one.model.table.tobytes() == other.model.table.tobytes()
    assert one.model.table.tobytes() != blobs(ROWS).table.tobytes()
    assert one.model.table.tobytes() != attacked_by(name, seed=1).model.table.tobytes()


@pytest.mark.parametrize("name", ["finetune", "prune_repair", "gspure_repair"])
def test_learning_the_appearance_leaves_the_geometry_bit_identical(name: str) -> None:
    attacked = attacked_by(name, learn="appearance")
    before = blobs(ROWS)[~attacked.prune_mask]
    assert not changed(before, attacked.model) & GEOMETRY
    assert changed(before, attacked.model) >= {"opacity", "f_dc_0"}
    assert changed(before, attacked_by(name).model) >= GEOMETRY


def test_prune_repair_keeps_the_rows_above_the_threshold_and_repairs_the_scene() -> None:
    attacked = attacked_by("prune_repair", tau=1.5, iterations=60)
    np.testing.assert_array_equal(attacked.prune_mask, plain_prune_mask(WEIGHTS, 1.5))
    damage_of = scene_damage(PublicModel(blobs(ROWS)), VIEWS)
    pruned = PublicModel(blobs(ROWS)[~attacked.prune_mask])
    assert damage_of(PublicModel(attacked.model)) < damage_of(pruned) - 0.1


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_gspure_repair_removes_the_rows_that_gspure_scaled_removes(scale: float) -> None:
    factors = {"scale": scale, "tau_c": 2.0, "tau_n": 1.5}
    measurements = Measurements(WEIGHTS, labels=LABELS)
    pruned = find_attack("gspure_scaled").apply(PublicModel(blobs(ROWS)), measurements, **factors)
    np.testing.assert_array_equal(attacked_by("gspure_repair", **factors).prune_mask, pruned.prune_mask)


def test_reestimate_changes_all_colours_and_keeps_the_rest_and_the_scene() -> None:
    attacked = attacked_by("reestimate", iterations=150)
    before = blobs(ROWS)
    colours = {name for name in before.table.dtype.names if name.startswith("f_")}
    assert changed(before, attacked.model) == colours
    zeros = PublicModel(before.with_columns(dict.fromkeys(colours, np.zeros(ROWS, np.float32))))
    damage_of = scene_damage(PublicModel(before), VIEWS)
    assert damage_of(PublicModel(attacked.model)) < 0.5 * damage_of(zeros)


def test_a_distilled_model_has_only_new_rows_and_a_comment() -> None:
    attacked = attacked_by("distil", iterations=20)
    assert attacked.prune_mask.all()
    assert any("vanilla 3DGS" in comment for comment in attacked.model.comments)
    assert attacked.model.sh_degree == 3
