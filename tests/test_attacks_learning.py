"""Attacks that render: learning from the model's own renders, and the search for a strength by its damage."""

import numpy as np
import pytest

from gspure.attacks import BUILT_IN, Attacked, Strength, find_attack
from gspure.attacks.learning import ATTACKS
from gspure.attacks.strength import EVALUATIONS, scene_damage, search
from gspure.cameras import Camera
from gspure.errors import InputError
from gspure.images import read_back
from gspure.method.pruning import plain_prune_mask, prune_mask
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.model import Gaussians
from gspure.public_model import PublicModel
from tests.anchor_cases import random_public
from tests.attack_cases import changed, measurements, photographs
from tests.models import blobs, camera, gaussians, tilted_camera

VIEWS = [camera(name="a"), tilted_camera(name="b")]
ROWS = 80
GEOMETRY = {"x", "y", "z", *(f"rot_{i}" for i in range(4)), *(f"scale_{i}" for i in range(3))}


def attacked_by(name: str, public: PublicModel | None = None, views=VIEWS, seed: int = 0, **settings) -> Attacked:
    public = public or PublicModel(blobs(ROWS))
    settings = {"iterations": 6, **settings}
    return find_attack(name).apply(public, measurements(len(public.model)), seed=seed, cameras=views, **settings)


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


def test_distil_by_the_fast_schedule_is_deterministic_and_no_vanilla_run() -> None:
    attacked, again, vanilla = (
        attacked_by("distil", iterations=20, schedule=schedule) for schedule in ("fast", "fast", "vanilla")
    )
    assert attacked.model.table.tobytes() == again.model.table.tobytes() != vanilla.model.table.tobytes()
    with pytest.raises(InputError, match="vanilla or fast"):
        attacked_by("distil", schedule="slow")


@pytest.fixture(params=["vanilla", "gs_hider", "secure_gs"])
def shown(request) -> tuple[PublicModel, list[Camera]]:
    """A public model, and two views of it."""
    if request.param == "vanilla":
        return PublicModel(blobs(ROWS)), VIEWS
    pytest.importorskip("torch")
    if request.param == "secure_gs":
        return random_public(60), VIEWS
    marked = request.getfixturevalue("trained")("gs_hider")
    return marked.public, marked.pair.scene.views[:2]


def test_distilling_leaves_the_format_of_a_scheme_which_removes_its_message(shown) -> None:
    public, views = shown
    attacked = attacked_by("distil", public, views, iterations=20)
    assert bool(attacked.removed) == (type(public) is not PublicModel)
    assert type(attacked.published(public)) is PublicModel
    assert {"f_dc_0", "rot_0"} <= {*attacked.model.names}


def test_reestimate_learns_every_colour_or_feature_again_and_keeps_the_scene(shown) -> None:
    public, views = shown
    attacked = attacked_by("reestimate", public, views, iterations=150)
    colours = set(public.columns["colour"])
    assert changed(public.model, attacked.model) == colours
    blank = public.model.with_columns(dict.fromkeys(colours, np.zeros(len(public.model), np.float32)))
    damage_of = scene_damage(public, views, photographs(public, views))
    assert damage_of(public.with_model(attacked.model)) < 0.7 * damage_of(public.with_model(blank))


def test_finetuning_everything_learns_what_the_networks_read(shown) -> None:
    public, views = shown
    tuned, again = (attacked_by("finetune", public, views).model for _ in range(2))
    assert tuned.table.tobytes() == again.table.tobytes()
    difference = changed(public.model, tuned)
    assert difference & set(public.columns["colour"])
    assert bool(difference & {"x", "rot_0"}) == (type(public) is PublicModel)
    offsets = {name for name in public.model.names if name.startswith("f_offset_")}
    assert not offsets or difference & offsets


def test_renders_are_learned_as_an_attack_on_them_leaves_them() -> None:
    def brightness(model: Gaussians) -> float:
        return np.mean([PublicModel(model).scene()(view).mean() for view in VIEWS])

    before = brightness(blobs(ROWS))
    for name in ("finetune", "distil"):
        attacked = attacked_by(name, iterations=150, render="brightness:0.5")
        assert brightness(attacked.model) == pytest.approx(before / 2, rel=0.15)


def test_densifying_adds_rows_in_other_places_and_names_their_parents() -> None:
    attacked = attacked_by("densify", iterations=40, share=0.2)
    assert len(attacked.model) > 1.2 * ROWS
    assert np.bincount(attacked.rows).max() > 1
    assert len(np.unique(attacked.model.means, axis=0)) == len(attacked.model)
    origins = blobs(ROWS).means[attacked.rows]
    assert (np.linalg.norm(attacked.model.means - origins, axis=1) < 1).mean() > 0.9


def test_remeshed_rows_are_new_flat_and_on_the_surface() -> None:
    places = np.stack(np.meshgrid(np.linspace(-2, 2, 15), np.linspace(-2, 2, 15), 5.0), axis=-1).reshape(-1, 3)
    wall = PublicModel(gaussians(means=places, scales=[0.3, 0.3, 0.02], opacities=0.95))
    attacked = attacked_by("remesh", wall)
    assert attacked.prune_mask.all()
    assert len(attacked.model) == len(places)
    assert np.abs(attacked.model.means[:, 2] - 5).max() < 0.15
    assert (attacked.model.scales.min(axis=1) < attacked.model.scales.max(axis=1) / 5).all()


@pytest.mark.parametrize("target", [0.3, 1.0, 2.0])
@pytest.mark.parametrize(
    ("strength", "damage"),
    [(Strength("fraction", 0.0, 1.0), lambda x: 30 * x**2), (Strength("tau", 100.0, 0.01, "log"), lambda x: 4 / x)],
)
def test_a_search_on_a_monotone_damage_meets_its_target_in_few_evaluations(strength, damage, target) -> None:
    tried = []
    match = search(strength, lambda x: tried.append(x) or damage(x), target)
    assert match.damage == damage(match.value) == pytest.approx(target, abs=DAMAGE_TOLERANCE)
    assert match.value in tried
    assert len(tried) <= EVALUATIONS


def test_an_unreachable_damage_gives_the_strongest_setting_and_its_damage() -> None:
    assert search(Strength("fraction", 0.0, 1.0), lambda x: x / 2, 2.0) == ("fraction", 1.0, 0.5)


@pytest.mark.parametrize("attack", [attack for attack in BUILT_IN if attack.strength], ids=lambda attack: attack.name)
def test_the_strong_end_of_every_strength_damages_more_than_the_weak_one(attack) -> None:
    public = PublicModel(blobs(200))
    damage_of = scene_damage(public, VIEWS, photographs(public, VIEWS))
    values = (attack.strength.at(end) for end in (0.0, 1.0))
    ends = [attack.apply(public, measurements(200), **{attack.strength.setting: value}) for value in values]
    weak, strong = (damage_of(PublicModel(end.model), None, end.retouched) for end in ends)
    assert weak < strong


def test_gspure_scaled_multiplies_both_factors() -> None:
    known = measurements(60)
    removed = find_attack("gspure_scaled").apply(blobs(60), known, scale=0.5, tau_c=3.0, tau_n=2.0).prune_mask
    np.testing.assert_array_equal(removed, prune_mask(known.labels, known.weights, 1.5, 1.0))


def test_photographs_that_are_renders_of_the_model_are_refused_if_all_are() -> None:
    public = PublicModel(blobs(50))
    renders = [read_back(public.scene()(view)) for view in VIEWS]
    with pytest.raises(InputError, match="photographs"):
        scene_damage(public, VIEWS, renders)
    photograph = renders[1] * 0.9
    noisy = PublicModel(find_attack("gaussian_noise").apply(public, sigma=0.2).model)
    of_both = scene_damage(public, VIEWS, [renders[0] * 0.9, photograph])(noisy)
    assert scene_damage(public, VIEWS, [renders[0], photograph])(noisy) == pytest.approx(of_both, rel=0.5)
