"""Attacks that learn from the public model's own renders: what they change and keep, through frozen networks too."""

import numpy as np
import pytest

from gspure.attacks import Attacked, find_attack
from gspure.attacks.learning import ATTACKS
from gspure.attacks.strength import scene_damage
from gspure.method.pruning import plain_prune_mask
from gspure.model import Gaussians
from gspure.public_model import PublicModel
from tests.anchor_cases import random_public
from tests.attack_cases import changed, measurements, photographs
from tests.models import blobs, camera, tilted_camera

VIEWS = [camera(name="a"), tilted_camera(name="b")]
ROWS = 80
GEOMETRY = {"x", "y", "z", *(f"rot_{i}" for i in range(4)), *(f"scale_{i}" for i in range(3))}


def attacked_by(name: str, public: PublicModel | None = None, seed: int = 0, **settings) -> Attacked:
    public = public or PublicModel(blobs(ROWS))
    settings = {"iterations": 6, **settings}
    return find_attack(name).apply(public, measurements(len(public.model)), seed=seed, cameras=VIEWS, **settings)


@pytest.mark.parametrize("name", [attack.name for attack in ATTACKS])
def test_the_same_arguments_give_the_same_bytes_and_change_the_model(name: str) -> None:
    attacked, again, other_seed = (attacked_by(name, seed=seed).model.table.tobytes() for seed in (0, 0, 1))
    assert attacked == again
    assert len({attacked, other_seed, blobs(ROWS).table.tobytes()}) == 3


@pytest.mark.parametrize("name", ["finetune", "prune_repair", "gspure_repair"])
def test_learning_the_appearance_leaves_the_geometry_bit_identical(name: str) -> None:
    attacked = attacked_by(name, learn="appearance")
    before = blobs(ROWS)[~attacked.prune_mask]
    assert not changed(before, attacked.model) & GEOMETRY
    assert changed(before, attacked.model) >= {"opacity", "f_dc_0"}
    assert changed(before, attacked_by(name).model) >= GEOMETRY


def test_prune_repair_keeps_the_rows_above_the_threshold_and_repairs_the_scene() -> None:
    attacked = attacked_by("prune_repair", tau=1.5, iterations=60)
    np.testing.assert_array_equal(attacked.prune_mask, plain_prune_mask(measurements(ROWS).weights, 1.5))
    public = PublicModel(blobs(ROWS))
    damage_of = scene_damage(public, VIEWS, photographs(public, VIEWS))
    pruned = PublicModel(blobs(ROWS)[~attacked.prune_mask])
    assert damage_of(PublicModel(attacked.model)) < damage_of(pruned) - 0.1


def test_a_distilled_model_depends_on_what_the_views_show_alone() -> None:
    hidden = {"opacity": np.full(ROWS, -20, np.float32)}  # below 1/255: never drawn
    first, second = (
        Gaussians(np.concatenate([blobs(ROWS).table, blobs(ROWS, seed).with_columns(hidden).table])) for seed in (1, 2)
    )
    assert first.table.tobytes() != second.table.tobytes()
    attacked = attacked_by("distil", PublicModel(first), iterations=20)
    attacked_second = attacked_by("distil", PublicModel(second), iterations=20)
    assert attacked.model.table.tobytes() == attacked_second.model.table.tobytes()
    assert attacked.prune_mask.all()
    assert any("vanilla 3DGS" in comment for comment in attacked.model.comments)
    assert attacked.model.sh_degree == 3


def gs_hider() -> PublicModel:
    pytest.importorskip("torch")
    from gspure.schemes.gs_hider.decoder import untrained
    from gspure.schemes.gs_hider.model import COLUMNS, FEATURES, SCENE_DECODER, DecoderFile, FeatureModel
    from gspure.training.initialization import gaussians_at
    from gspure.training.output import as_gaussians

    rng = np.random.default_rng(0)
    depths = rng.uniform(3, 9, 60)
    points = np.stack([*(rng.uniform(-0.6, 0.6, (2, 60)) * depths), depths], axis=1)
    placed = as_gaussians(gaussians_at(points, np.zeros((60, 3), np.uint8)))
    columns = {name: placed.table[name] for name in COLUMNS if name not in FEATURES}
    columns |= {name: rng.normal(0, 2, 60).astype(np.float32) for name in FEATURES}
    rows = Gaussians(np.zeros(60, [(name, "<f4") for name in COLUMNS]))
    opaque = rows.with_columns({**columns, "opacity": np.full(60, 3, np.float32)})
    (decoder,) = untrained(1, 0)
    for name, parameter in decoder.named_parameters():
        parameter.data *= 2.4 if name.endswith("weight") else 1  # else its image hardly depends on the features
    decoder.conv5.bias.data += 0.5
    return FeatureModel(opaque, DecoderFile.from_network(decoder, 1, SCENE_DECODER))


def secure_gs() -> PublicModel:
    pytest.importorskip("torch")
    return random_public(60)


@pytest.mark.parametrize("scheme", ["gs_hider", "secure_gs"])
def test_distilling_leaves_the_format_of_a_scheme_which_removes_its_message(scheme: str) -> None:
    public = MODELS[scheme]()
    attacked = attacked_by("distil", public, iterations=20)
    assert attacked.removed
    assert type(attacked.published(public)) is PublicModel
    assert {"f_dc_0", "rot_0"} <= {*attacked.model.names}
    assert not attacked_by("distil").removed


MODELS = {"vanilla": lambda: PublicModel(blobs(ROWS)), "gs_hider": gs_hider, "secure_gs": secure_gs}


@pytest.mark.parametrize("scheme", MODELS)
def test_reestimate_learns_every_colour_or_feature_again_and_keeps_the_scene(scheme: str) -> None:
    public = MODELS[scheme]()
    attacked = attacked_by("reestimate", public, iterations=150)
    colours = set(public.columns["colour"])
    assert changed(public.model, attacked.model) == colours
    blank = public.model.with_columns(dict.fromkeys(colours, np.zeros(len(public.model), np.float32)))
    damage_of = scene_damage(public, VIEWS, photographs(public, VIEWS))
    assert damage_of(public.with_model(attacked.model)) < 0.7 * damage_of(public.with_model(blank))


@pytest.mark.parametrize(("scheme", "kept"), [("gs_hider", {"scale_0", "x", "rot_0"}), ("secure_gs", {"x", "rot_0"})])
def test_finetuning_everything_learns_what_the_networks_read(scheme: str, kept: set[str]) -> None:
    public = MODELS[scheme]()
    tuned, again = (attacked_by("finetune", public).model for _ in range(2))
    assert tuned.table.tobytes() == again.table.tobytes()
    difference = changed(public.model, tuned)
    assert difference & set(public.columns["colour"])
    assert not difference & kept
    assert scheme == "gs_hider" or difference & {f"f_offset_{i}" for i in range(12)}
