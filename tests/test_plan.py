"""The files and settings of jobs: of models, of their variants and controls, and of decisions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from gspure.cameras import write_cameras
from gspure.errors import InputError
from gspure.files import write_json
from gspure.images import write_image
from gspure.metrics.names import CLEAN_GSPURE, CONTROLS, OTHER_SCENE
from gspure.model import write_model
from gspure.workflow.decisions import MADE, METHOD, factors_of, first_alike
from gspure.workflow.plan import Model, Plan
from gspure.workflow.variants import Variant, evaluation, report_plan, reported
from tests.models import blobs, tilted_camera
from tests.workflow_cases import ROOT, plan_of

CONFIG = yaml.safe_load("""
assets: {bot: {model: README.md, cameras: orbit}}
pairs: {raised: {}, front: {message: room, placement: front}}
schemes: {splats_in_splats: {seed: 3, iterations: 60}, secure_gs: {}}
repetitions: 2
decisions: {same: {}, leaf: {selection: leaf}, blind: {cluster_on: [position, opacity]}, mild: {tau_n: 1.5}}
variants:
  unattacked: {}
  gspure: {}
  leaf: {attack: gspure, decision: leaf}
  mild: {attack: gspure, decision: mild}
  plain_weight: {decision: mild}
  noise: {attack: gaussian_noise, sigma: 0.2, seed: 5}
""")
FOLDER = "results/splats_in_splats/raised@1"


def changed(**changes) -> Plan:
    return plan_of({name: value for name, value in {**CONFIG, **changes}.items() if value is not None})


@pytest.fixture(scope="module")
def plan() -> Plan:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        return changed()


@pytest.fixture
def bot(plan) -> Model:
    return Model(plan, "vanilla", "bot")


@pytest.fixture
def again(plan) -> Model:
    """A repetition of a scheme on a pair."""
    return Model(plan, "splats_in_splats", "raised@1")


def test_there_is_a_model_of_each_asset_and_of_each_scheme_pair_and_repetition(plan):
    scenes = ["raised", "raised@1", "front", "front@1"]
    schemes = ["splats_in_splats", "secure_gs"]
    expected = ["results/vanilla/bot", *(f"results/{scheme}/{scene}" for scheme in schemes for scene in scenes)]
    assert [model.folder for model in plan.models] == expected


def test_a_repetition_has_the_pair_and_other_seeds(again):
    assert again.pair == "results/pairs/raised"
    assert again.embed_settings == {"seed": 4, "initialization": "both", "set": {"iterations": 60}}
    assert Variant(again, "noise").attacked_by["seed"] == 6


def test_a_users_model_is_read_in_place_and_compared_with_its_renders(bot):
    assert bot.public == bot.users_files[0] == "README.md"
    assert (bot.view_files, bot.targets, bot.controls, bot.decoys) == ([], ["scene"], [], [])
    assert bot.view_settings["generated"]["count"] == 24
    settings = evaluation(bot, ["gspure"])
    assert (settings["unattacked"], settings["photographed"]) == ("results/vanilla/bot/unattacked/renders", [])
    assert "key" not in settings


@pytest.fixture
def marked(tmp_path, monkeypatch):
    """The entry of a user's marked model, whose cameras name no photographs."""
    monkeypatch.chdir(tmp_path)
    write_model(tmp_path / "marked.ply", blobs(4))
    write_cameras(tmp_path / "views.json", [tilted_camera(8, 6, name="v")])
    provenance = {"settings": {"scheme": "splats_in_splats"}, "inputs": {"pair": {"path": "pair"}}}
    write_json(tmp_path / "key" / "provenance.json", provenance)
    return {"model": "marked.ply", "cameras": "views.json", "key": "key"}


def test_a_key_names_the_scheme_of_a_users_model(marked):
    (model,) = changed(assets={"mine": marked}, pairs=None, schemes=None).models
    assert model.folder == "results/splats_in_splats/mine"
    assert (model.public, model.owned["key"]) == ("marked.ply", "key")
    assert {"marked.ply", "key/provenance.json"} <= {*model.users_files}
    assert model.controls == ["wrong_key", "black", "mean_colour"]
    assert model.views == {"scene": "views.json", "message": "views.json"}
    assert evaluation(model, ["gspure"])["photographed"] == []


def test_photographs_of_message_and_scene_are_what_a_users_model_is_compared_with(marked, tmp_path):
    for folder in (tmp_path, tmp_path / "message"):
        write_image(folder / "v.png", np.zeros((6, 8, 3)))
        write_cameras(folder / "views.json", [replace(tilted_camera(8, 6, name="v"), image=folder / "v.png")])
    (model,) = changed(assets={"mine": marked | {"message": "message/views.json"}}, pairs=None, schemes=None).models
    assert evaluation(model, ["gspure"])["photographed"] == ["scene", "message"]
    assert model.view_settings == {"resolution": "1600px", "message_resolution": "photographs"}
    assert str(tmp_path / "message" / "v.png") in {str(Path(file).resolve()) for file in model.users_files}


def test_a_key_of_unknown_origin_needs_the_name_of_its_scheme(marked, tmp_path):
    (tmp_path / "key" / "provenance.json").unlink()
    with pytest.raises(InputError, match=r"key/provenance\.json: no such file"):
        changed(assets={"mine": marked}, pairs=None, schemes=None)
    (model,) = changed(assets={"mine": marked | {"scheme": "keyss"}}, pairs=None, schemes=None).models
    assert model.scheme == "keyss"


def test_chosen_extractions_are_those_that_are_compared(again):
    assert again.targets == ["scene", "message", "message_adaptive", "message_oracle"]
    chosen = changed(assets=None, extractions=["message", "message_oracle"])
    assert chosen.models[0].targets == ["scene", "message", "message_oracle"]
    assert evaluation(chosen.models[0], ["gspure"])["published"] is None


def test_another_scenes_model_is_a_control_only_if_it_hides_another_message(again):
    assert again.controls == [name for name in CONTROLS if name != CLEAN_GSPURE]
    assert Variant(again, OTHER_SCENE).public == "results/splats_in_splats/front/public/point_cloud.ply"
    alike = changed(assets=None, pairs={"raised": {}, "front": {"placement": "front"}}).models[0]
    assert alike.controls == [name for name in again.controls if name != OTHER_SCENE]
    searched = changed(assets=None, variants={"unattacked": {}, "gspure": {}, "gof": {"damage": 1}}).models[0]
    assert searched.controls == list(CONTROLS)
    purified = Variant(searched, CLEAN_GSPURE)
    assert purified.public == Variant(searched, "clean").public == f"{searched.folder}/clean/public/point_cloud.ply"
    assert purified.evaluation["compared"] == ["scene"]
    assert purified.evaluation["purified"] == searched.decision(METHOD)


def test_of_hidden_bits_only_variants_and_the_clean_model_are_compared():
    model = changed(assets=None, schemes={"marked_clones": {}}, repetitions=1).models[0]
    assert model.controls == ["clean", "wrong_key", "other_scene"]
    compared = {name: Variant(model, name).evaluation["compared"] for name in ("gspure", *model.controls)}
    assert compared == {"gspure": ["scene"], "clean": ["scene"], "wrong_key": [], "other_scene": []}
    assert all([*Variant(model, name).detectors] == ["bits"] for name in ("gspure", *model.controls))
    assert reported(model).controls == ["clean"]


def test_a_search_for_a_damage_sets_no_strength(again, monkeypatch):
    monkeypatch.chdir(ROOT)
    plan = changed(variants={**CONFIG["variants"], "plain_weight": {"decision": "mild", "damage": [0.3, 1]}})
    weak = Variant(replace(again, plan=plan), "plain_weight@0.3dB")
    assert (weak.attacked_by["seed"], weak.attacked_by["settings"], weak.attacked_by["damage"]) == (1, {}, 0.3)


def test_an_attack_takes_what_is_measured_and_the_factors_of_its_decision(again, monkeypatch):
    assert Variant(again, "leaf").measured == {"prune_mask": f"{FOLDER}/decisions/leaf/prune_mask.npy"}
    attack = Variant(again, "plain_weight")
    assert (attack.measured, attack.attacked_by["settings"]) == ({"weights": f"{FOLDER}/weights.npy"}, {"tau": 1.5})
    monkeypatch.chdir(ROOT)
    scaled = {"attack": "gspure_scaled", "decision": "blind", "scale": 0.5}
    scaled = Variant(replace(again, plan=changed(variants={**CONFIG["variants"], "scaled": scaled})), "scaled")
    clusters = f"{FOLDER}/decisions/blind/clusters.npz"
    assert scaled.measured == {"labels": clusters, "weights": f"{FOLDER}/opacities.npy"}
    assert scaled.attacked_by["settings"] == {"tau_c": 4.0, "tau_n": 4.0, "scale": 0.5}


def test_factors_that_are_null_suit_the_scheme(plan):
    factors = [(d["tau_c"], d["tau_n"]) for d in (plan.decisions[name][METHOD] for name in plan.schemes)]
    assert factors == [(4.0, 4.0), (3.0, 2.0)]


@pytest.mark.parametrize(
    ("setting", "value", "first"),
    [("energy", "ewa", "contributions"), ("min_samples", 7, "tree.npy"), ("tau_n", 9.0, "prune_mask.npy")],
)
def test_decisions_share_what_is_made_before_the_first_setting_in_which_they_differ(setting, value, first):
    among = changed(assets=None, decisions={"own": {setting: value}}, variants=None).decisions["secure_gs"]
    shared = [made for made in MADE if first_alike(among, "own", made) == METHOD]
    assert shared == [*MADE][: [*MADE].index(first)]


def test_a_sweep_is_one_attack_at_several_strengths_and_nothing_else(plan):
    variants = {
        "unattacked": {},
        "gspure": {},
        "gentle": {"attack": "gspure", "decision": "gentle"},
        "leaf": {"attack": "gspure", "decision": "leaf"},
        "gentle_leaf": {"attack": "gspure", "decision": "gentle_leaf"},
        "half": {"attack": "random_pruning", "fraction": 0.5},
        "random_pruning": {},
        "gspure_scaled": {"damage": [0.3, 2]},
        "plain_weight": {},
    }
    own = {"gentle": {"tau_n": 9}, "leaf": {"selection": "leaf"}, "gentle_leaf": {"selection": "leaf", "tau_c": 9}}
    plan = changed(assets=None, decisions=own, variants=variants)
    assert report_plan(plan).sweeps == {
        "gspure": ["gspure", "gentle", "gspure_scaled@0.3dB", "gspure_scaled@2dB"],
        "gspure leaf": ["leaf", "gentle_leaf"],
        "random_pruning": ["half", "random_pruning"],
    }
    assert report_plan(plan).points["secure_gs"] == {"gspure": (2.0, 3.0), "gentle": (9, 3.0)}
    assert factors_of(plan.config["variants"], plan.decisions["secure_gs"]) == report_plan(plan).points["secure_gs"]
