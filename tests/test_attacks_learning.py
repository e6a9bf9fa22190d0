"""Attacks that learn from the public model's own renders: what they are given, change and keep."""

import numpy as np
import pytest

from gspure.attacks import Attacked, Measurements, find_attack
from gspure.attacks.learning import ATTACKS
from gspure.attacks.strength import scene_damage
from gspure.errors import InputError
from gspure.images import read_back
from gspure.method.pruning import plain_prune_mask
from gspure.opencl.trainable import TrainableModel
from gspure.public_model import PublicModel
from tests.attack_cases import changed, public
from tests.documentation import ROOT, blocks
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


@pytest.mark.parametrize("name", NAMES)
def test_damage_needs_no_photographs_key_or_message(name: str) -> None:
    assert find_attack(name).parameters <= {"public", "cameras", "device", "weights", "labels"}


@pytest.mark.parametrize("name", NAMES)
def test_an_attack_renders_and_trains_on_the_background_of_the_model(name: str, monkeypatch) -> None:
    white, images, backgrounds = (1.0, 1.0, 1.0), [], []
    model, step = PublicModel(blobs(ROWS).with_background(white)), TrainableModel.step
    set_targets = TrainableModel.set_targets

    def stepped(self, *view, background=(0.0, 0.0, 0.0), **settings):
        backgrounds.append(background)
        return step(self, *view, background=background, **settings)

    monkeypatch.setattr(TrainableModel, "step", stepped)
    monkeypatch.setattr(TrainableModel, "set_targets", lambda self, of: (images.extend(of), set_targets(self, of)))
    measurements = Measurements(WEIGHTS, labels=LABELS) if find_attack(name).needs else Measurements()
    find_attack(name).apply(model, measurements, cameras=VIEWS, iterations=2)
    assert {*backgrounds} == {white}
    np.testing.assert_array_equal(images[0], read_back(model.scene(background=white)(VIEWS[0])))


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


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("finetune", {"iterations": 0}, "iterations: expected a whole number from 1"),
        ("finetune", {"learn": "sky"}, "attack finetune: learn: expected one of all, appearance, colour"),
        ("distil", {"iterations": 0}, "iterations: expected a whole number from 1"),
    ],
)
def test_bad_settings_are_refused(name: str, settings: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        attacked_by(name, **settings)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("iterations", [1, 7])
def test_the_budget_is_the_number_of_training_steps(name: str, iterations: int, monkeypatch) -> None:
    views, train = [], TrainableModel.step

    def step(self, camera, *numbers, **settings):
        views.append(camera)
        return train(self, camera, *numbers, **settings)

    monkeypatch.setattr(TrainableModel, "step", step)
    attacked_by(name, iterations=iterations)
    assert len(views) == iterations
    assert all(view.image is None for view in views)


@pytest.mark.parametrize("scheme", ["vanilla", "gs_hider"])
def test_an_attack_of_another_package_learns_like_the_built_in_ones(scheme: str) -> None:
    module: dict = {}
    exec(next(code for code in blocks(ROOT / "docs" / "extending.md", "python") if "recolour" in code), module)  # noqa: S102
    if scheme == "gs_hider":
        pytest.importorskip("torch")
        from tests.test_attacks_learning_networks import gs_hider

    asset = PublicModel(blobs(ROWS)) if scheme == "vanilla" else gs_hider()
    ours = module["ATTACK"].apply(asset, Measurements(), cameras=VIEWS, iterations=6)
    assert changed(asset.model, ours.model) <= {*asset.columns["colour"]}
    built_in = find_attack("finetune").apply(asset, Measurements(), cameras=VIEWS, iterations=6, learn="colour")
    assert ours.model.table.tobytes() == built_in.model.table.tobytes()


def test_without_views_there_is_nothing_to_learn_from() -> None:
    with pytest.raises(InputError, match="cameras: expected public views"):
        find_attack("finetune").apply(blobs(3), Measurements())


def test_only_3dgs_is_distilled() -> None:
    from tests.attack_cases import features

    with pytest.raises(InputError, match="distil: not applicable"):
        find_attack("distil").apply(public(features(9)), Measurements(), cameras=VIEWS)
