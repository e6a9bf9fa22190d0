"""The search for a strength by its damage, and the published strengths."""

import numpy as np
import pytest

from gspure.attacks import BUILT_IN, Strength, find_attack
from gspure.attacks.strength import EVALUATIONS, scene_damage, search
from gspure.errors import InputError
from gspure.images import read_back
from gspure.method.pruning import prune_mask
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.public_model import PublicModel
from tests.attack_cases import measurements, photographs
from tests.models import blobs, camera, tilted_camera

STRONG = [attack for attack in BUILT_IN if attack.strength]
VIEWS = [camera(name="a"), tilted_camera(name="b")]


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


@pytest.mark.parametrize("attack", STRONG, ids=lambda attack: attack.name)
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
