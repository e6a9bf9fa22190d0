"""Every attack of the registry: pure, seeded, behind one protocol; and plug-ins."""

import inspect
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from gspure import plugins
from gspure.attacks import (
    BUILT_IN,
    GROUP,
    Attack,
    Attacked,
    Measurements,
    NotApplicable,
    attacks,
    compression,
    find_attack,
    learning,
    pruning,
    renders,
)
from gspure.errors import InputError
from tests.attack_cases import KINDS, apply, measurements
from tests.models import blobs

COUNT = 40
ELSEWHERE = (*compression.ATTACKS, *learning.ATTACKS, *renders.ATTACKS)  # need a package or views, or act on these
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
    # The derivative of a blurred step is the Gaussian.
    slope = np.diff(renders.blur(step, rng, radius=3.0)[32, :, 0].astype(np.float64))
    places = np.arange(len(slope))
    mean = slope @ places / slope.sum()
    variance = slope @ (places - mean) ** 2 / slope.sum()
    assert np.sqrt(variance) == pytest.approx(3.0, rel=0.1)
    ramp = np.linspace(0, 1, 64, dtype=np.float32)[None, :, None] * np.ones((64, 1, 3), np.float32)
    assert np.ptp(renders.resized_crop(ramp, rng, area=0.25)) == pytest.approx(0.5, abs=0.03)
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
        ("feature_scaling", {"factor": float("nan")}, "factor: expected a number from 0"),
        ("feature_scaling", {"attributes": "color"}, "attributes: expected one or more of colour,base_colour,opacity"),
        ("plain_weight", {"tau": 0.0}, "tau: expected a number above 0"),
        ("quantize", {"bits": 9}, "bits: expected 1 to 8, or 16"),
        ("rigid_transform", {"axis": "0,0,0"}, "axis: expected an axis"),
        ("rigid_transform", {"translation": "1,x,2"}, "translation: expected three numbers"),
        ("random_pruning", {"seed": -1}, "seed: expected a whole number from 0 .* found -1"),
    ],
)
def test_bad_settings_are_refused(name: str, settings: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        apply(name, blobs(COUNT), **settings)


def half(model, _rng, weights, *, upper: int = 1) -> Attacked:
    return Attacked.without(model, (weights > np.median(weights)) != bool(upper))


HALF = Attack("half", half)
TAKEN = Attack("gspure", half)
GREEDY = Attack("greedy", lambda model, rng, key: Attacked.without(model, key))


@pytest.fixture
def offer(monkeypatch: pytest.MonkeyPatch):
    """Return a function that offers a plug-in of this module."""

    def register(target: str) -> None:
        entry = EntryPoint("theirs", f"{__name__}:{target}", GROUP)
        monkeypatch.setattr(plugins, "_entries", lambda group, _: [entry] if group == GROUP else [])

    return register


def test_a_plug_in_is_found_by_its_entry_point(offer) -> None:
    offer("HALF")
    attack = find_attack("half")
    assert (attack.needs, attack.settings) == ({"weights"}, {"upper": 1})
    assert len(attack.apply(blobs(COUNT), measurements(COUNT)).model) == COUNT // 2


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("MISSING", "expected an importable gspure.attacks.Attack, found AttributeError"),
        ("half", "expected an importable gspure.attacks.Attack, found function"),
        ("TAKEN", "name: expected a name not in use, found 'gspure'"),
        ("GREEDY", "needs: expected of columns, labels, opacities, .*, weights, found key"),
    ],
)
def test_a_bad_plug_in_is_named(offer, target: str, message: str) -> None:
    offer(target)
    with pytest.raises(InputError, match=r"\(entry point 'theirs' of gspure.attacks\): .*" + message):
        attacks()


def test_what_a_plug_in_returns_is_checked() -> None:
    with pytest.raises(InputError, match="rows: expected"):
        Attack("faulty", lambda model, _rng: Attacked(model, np.arange(3), len(model))).apply(blobs(COUNT))
