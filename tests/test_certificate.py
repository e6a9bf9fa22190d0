"""What `gspure check-plugin` finds wrong with schemes, attacks and detectors that break one rule each."""

import shlex
import shutil
import sys
from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from gspure.attacks import Attack, Attacked, Strength, find_attack
from gspure.certificate.check import Check
from gspure.certificate.of_attacks import Trial, attack_checks
from gspure.certificate.of_detectors import detector_checks
from gspure.certificate.of_schemes import scheme_checks
from gspure.cli import check_plugin, main
from gspure.public_model import PublicModel
from gspure.schemes.registry import find_scheme

SEEDS = count()
PLANTED = find_scheme("planted")


def embed_anew(pair, seed, device=None, *, message_weight=1, gaussians=300):
    return PLANTED.embed(pair, next(SEEDS), message_weight=message_weight, gaussians=gaussians)


def embed_always(pair, seed, device=None, *, message_weight=1, gaussians=300):
    return PLANTED.embed(pair, seed, gaussians=gaussians)


def read_turned(path):
    return PublicModel(PublicModel.read(path).model[::-1])


def read_anything(folder):
    return PLANTED.read_key(folder) if [*folder.iterdir()] else None


BROKEN_SCHEMES = {
    "has a plain name": {"name": "My scheme"},
    "declares columns that its file has": {"extractions": {"message": ("no_column",)}},
    "reads its files back": {"read_public": read_turned},
    "gives the same files with the same seed": {"embed": embed_anew},
    "refuses a folder without its files": {"read_key": read_anything},
    "trains a clean model without a key": {"embed": embed_always},
}


@pytest.mark.parametrize(("rule", "fault"), [("", {}), *BROKEN_SCHEMES.items()])
def test_a_scheme_fails_the_check_of_the_rule_that_it_breaks(rule, fault, pair, tmp_path) -> None:
    found = [*scheme_checks(replace(PLANTED, **fault), pair, {"gaussians": 300}, tmp_path)]
    assert [check.name for check in found if check.is_rule and not check.passed] == [rule] * bool(rule)
    assert len(found) == 10


def shift(model, rng, *, by: float = 1.0) -> Attacked:
    return Attacked.changed(model, {"x": model.table["x"] + by})


def shift_at_random(model, rng, *, by: float = 1.0) -> Attacked:
    return shift(model, rng, by=next(SEEDS))


def shift_in_place(model, rng, *, by: float = 1.0) -> Attacked:
    model.table["x"] += 1
    return shift(model, rng)


def cropped(image, rng) -> np.ndarray:
    return image[1:]


def overexposed(image, rng) -> np.ndarray:
    return np.full_like(image, np.inf)


def darkened_in_place(image, rng) -> np.ndarray:
    image *= 0.5
    return image


BROKEN_ATTACKS = {
    "has a plain name": Attack("Shift", shift),
    "explains its settings, and names its source": Attack("unexplained", shift),
    "returns finite images of the same shape": Attack("cropped", cropped, of_renders=True),
    "leaves renders as they are": Attack("darkened", darkened_in_place, of_renders=True),
    "does no less damage at the strong end": Attack("weak", shift, strength=Strength("by", 1.0, 0.0)),
    "gives the same result with the same seed": Attack("random", shift_at_random),
    "leaves its input as it is": Attack("in_place", shift_in_place),
}


KEPT = [("", find_attack(name)) for name in ("random_pruning", "gof", "resize")]


@pytest.mark.parametrize(("rule", "attack"), [*KEPT, *BROKEN_ATTACKS.items()])
def test_an_attack_fails_the_check_of_the_rule_that_it_breaks(rule, attack, pair) -> None:
    dataset = pair.scene.dataset
    public, _ = PLANTED.embed(pair, 0, gaussians=300)
    found = attack_checks(Trial(attack, public, dataset.train, dataset.test))
    broken = [(check.name, check.problem) for check in found if not check.passed]
    assert rule in dict(broken) if rule else broken == []


def test_an_attack_on_renders_that_returns_infinities_breaks_a_rule(pair) -> None:
    public, _ = PLANTED.embed(pair, 0, gaussians=300)
    trial = Trial(Attack("overexposed", overexposed, of_renders=True), public, (), pair.scene.dataset.test)
    found = {check.name: check.problem for check in attack_checks(trial)}
    assert found["returns finite images of the same shape"] == "some numbers are not finite"


PER_IMAGE = """
import json, pathlib, random, sys
print(json.dumps({{path.stem: {} for path in pathlib.Path(sys.argv[1]).iterdir()}}))
"""
OF_MODEL = """print('{"model": "0110"}')"""


@pytest.mark.parametrize(
    ("rule", "name", "program"),
    [
        ("", "bits", PER_IMAGE.format("'0110'")),
        ("", "scores", PER_IMAGE.format("path.stat().st_size")),
        ("", "of_model", OF_MODEL),
        ("has a plain name", "2nd mark", OF_MODEL),
        ("reads renders, or the model's file", "mute", "print({})"),
        ("reads renders, or the model's file", "wordy", PER_IMAGE.format("'blue'")),
        ("gives the same answer again", "dice", PER_IMAGE.format("random.random()")),
    ],
)
def test_a_detector_fails_the_check_of_the_rule_that_it_breaks(rule, name, program, pair_folder, tmp_path) -> None:
    (tmp_path / "model.ply").touch()
    command = shlex.join([sys.executable, "-c", program])
    found = detector_checks(name, command, pair_folder / "message", tmp_path / "model.ply")
    assert [check.name for check in found if not check.passed] == [rule] * bool(rule)


def test_an_attack_with_nothing_to_act_on_breaks_no_rule(pair) -> None:
    public, _ = PLANTED.embed(pair, 0, gaussians=300)
    found = attack_checks(Trial(find_attack("collusion"), public, pair.scene.views, pair.scene.dataset.test))
    assert [(check.is_rule, check.passed) for check in found] == [(True, True), (True, True), (False, False)]


@pytest.mark.parametrize(("is_rule", "status", "mark"), [(True, 1, "FAILED"), (False, 0, "note")])
def test_a_line_per_check_is_printed_and_a_broken_rule_fails(is_rule, status, mark, monkeypatch, capsys) -> None:
    found = [Check("applies"), Check("repeats", "rows differ", is_rule)]
    monkeypatch.setattr(check_plugin, "_checks", lambda *_: found)
    assert main(["check-plugin", "crop"]) == status
    assert capsys.readouterr().out.split("\n")[:2] == [" 1  ok      applies", f" 2  {mark:<7} repeats: rows differ"]


@pytest.mark.parametrize(("name", "rules"), [("reorder", 6), ("green", 3)])
def test_the_command_checks_an_attack_or_a_detector(name, rules, pair_folder, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "green.py").write_text(PER_IMAGE.format("1.0"))
    monkeypatch.setattr(check_plugin, "make_pair", lambda _, folder: shutil.copytree(pair_folder, folder))
    monkeypatch.setattr(check_plugin, "STEPS", 2)
    assert main(["check-plugin", name]) == 0
    assert capsys.readouterr().out.count("  ok ") == rules
