"""The files and options of jobs: of models, of their variants and controls, and of decisions."""

from __future__ import annotations

import shlex
from dataclasses import replace

import pytest
import yaml

from gspure.evaluation.controls import BASELINES, CONTROLS, OTHER_SCENE
from gspure.workflow.configuration import resolved, validated
from gspure.workflow.models import Model, Plan
from gspure.workflow.variants import Decision, Variant
from tests.documentation import ROOT

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


def plan_of(**changes) -> Plan:
    config = {name: value for name, value in {**CONFIG, **changes}.items() if value is not None}
    return Plan(resolved(validated(config, ROOT / "schemas" / "config.schema.yaml", "mine.yaml"), "mine.yaml"))


@pytest.fixture(scope="module")
def plan() -> Plan:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        return plan_of()


@pytest.fixture
def bot(plan) -> Model:
    return Model(plan, "vanilla", "bot")


@pytest.fixture
def again(plan) -> Model:
    """A repetition of a scheme on a pair."""
    return Model(plan, "splats_in_splats", "raised@1")


def test_chosen_extractions_are_those_that_are_compared(again):
    assert again.targets == ["scene", "message", "message_adaptive", "message_oracle"]
    plan = plan_of(assets=None, extractions=["message", "message_oracle"])
    targets = {model.scheme: model.targets for model in plan.models}
    assert targets == {
        "splats_in_splats": ["scene", "message", "message_oracle"],
        "secure_gs": ["scene", "message"],
    }


def test_candidates_of_the_retrieval_are_other_messages_and_random_scenes_of_the_same_size(again):
    others, traced = ([path for path in again.decoys if ("/pairs/" in path) == is_pair] for is_pair in (True, False))
    assert others == ["results/pairs/front/message"]
    assert len(traced) == 10
    assert traced == [f"results/decoys/160x120x4/{seed}" for seed in range(9000, 9010)]


def test_there_is_a_model_of_each_asset_and_of_each_scheme_pair_and_repetition(plan):
    scenes = ["raised", "raised@1", "front", "front@1"]
    schemes = ["splats_in_splats", "secure_gs"]
    expected = ["results/vanilla/bot", *(f"results/{scheme}/{scene}" for scheme in schemes for scene in scenes)]
    assert [model.folder for model in plan.models] == expected


def test_a_repetition_has_the_pair_and_other_seeds(again):
    assert again.pair["cameras"] == again.camera_source("scene") == "results/pairs/raised/cameras.json"
    assert again.embedding_options() == "--seed 4 --initialization both --set iterations=60"
    weighted = Model(plan_of(assets=None, schemes={"gs_hider": {"message_weight": 0.25}}), "gs_hider", "raised")
    assert weighted.embedding_options(message_weight=0).endswith("--set message_weight=0")
    assert weighted.embedding_options(message_weight=0).count("message_weight") == 1
    assert "--seed 6" in Variant(again, "noise").attack_options


def test_a_users_model_is_read_in_place_and_compared_with_its_renders(bot):
    assert bot.public == "README.md"
    assert (bot.camera_files("scene"), bot.targets, bot.controls, bot.hidden) == ([], ["scene"], [], [])
    assert bot.camera_options.startswith("--model README.md --count 24")
    assert bot.references == Variant(bot, "unattacked").renders == ["results/vanilla/bot/unattacked/renders/scene"]
    assert Variant(bot, "gspure").comparison_options == "--targets scene --reference render"


def test_another_scenes_model_is_a_control_only_if_it_hides_another_message(again):
    assert again.controls == list(CONTROLS)
    assert Variant(again, OTHER_SCENE).public == "results/splats_in_splats/front/public/point_cloud.ply"
    alike = Model(plan_of(assets=None, pairs={"raised": {}, "front": {"placement": "front"}}), "secure_gs", "raised")
    assert alike.controls == [name for name in CONTROLS if name != OTHER_SCENE]


def test_a_wrong_key_is_tried_on_the_message_of_the_public_model(again):
    control = Variant(again, "wrong_key")
    assert control.public == again.public
    assert control.extraction_options("message") == "--scheme splats_in_splats --extraction message --wrong-key 1"
    assert [folder.rpartition("/")[2] for folder in control.renders] == [
        "message",
        "message_adaptive",
        "message_oracle",
    ]
    assert "transform" not in control.view_files("message")


@pytest.mark.parametrize("name", BASELINES)
def test_a_baseline_is_compared_in_the_views_of_the_unattacked_model(again, name):
    assert Variant(again, name).renders == Variant(again, "unattacked").renders
    options = shlex.split(Variant(again, name).comparison_options)
    against = ["--against", "message_adaptive=message", "--against", "message_oracle=message"]
    targets = ["scene", "message", "message_adaptive", "message_oracle"]
    assert options == ["--targets", *targets, "--reference", "truth", *against, "--baseline", name]


def test_photographed_pairs_have_no_views_off_the_path(plan, again):
    assert "off_path" in Variant(again, "gspure").view_files("scene")
    config = {**plan.config, "pairs": {"raised": {**plan.config["pairs"]["raised"], "photographs": []}}}
    photographed = replace(again, plan=Plan(config))
    files = {"cameras": f"{again.folder}/cameras.json", "transform": f"{again.folder}/gspure/transform.npy"}
    assert Variant(photographed, "gspure").view_files("scene") == files


def test_only_the_owner_has_the_views_of_the_message(plan, again):
    assert again.camera_source("message") == again.pair["message"]
    assert Variant(again, "gspure").view_files("message_oracle")["cameras"] == f"{again.folder}/message_cameras.json"
    assert Variant(again, "gspure").view_files("scene")["cameras"] == f"{again.folder}/cameras.json"
    for name in plan.config["variants"]:
        attack = Variant(again, name)
        assert "message" not in f"{attack.attack_options} {attack.evidence}"


def test_only_a_fitting_owner_gets_photographs_and_no_attack_does(plan, again):
    learned = Variant(Model(plan, "secure_gs", "raised"), "gspure")
    assert learned.view_files("message_adaptive")["photographs"] == "results/pairs/raised/message"
    assert "--photographs results/pairs/raised/message" in learned.view_options("message_adaptive")
    assert "photographs" not in learned.view_files("message") | learned.view_files("scene")
    assert "photographs" not in Variant(again, "gspure").view_files("message_adaptive")
    assert "photographs" not in f"{learned.attack_options} {learned.render_files}"


def test_only_an_owner_who_adapts_has_to_find_out_how_the_model_moved(again):
    attacked = Variant(again, "gspure")
    assert attacked.view_files("message_adaptive")["original"] == again.public
    assert "transform" not in attacked.view_files("message_adaptive")
    for target in ("scene", "message", "message_oracle"):
        assert "transform" in attacked.view_files(target)
        assert "original" not in attacked.view_files(target)


def test_an_attack_takes_the_evidence_and_the_factor_of_its_decision(again):
    assert Variant(again, "leaf").evidence == {"prune_mask": f"{again.folder}/decisions/leaf/prune_mask.npy"}
    attack = Variant(again, "plain_weight")
    assert attack.evidence == {"weights": f"{again.folder}/weights.npy"}
    options = f"--weights {again.folder}/weights.npy --seed 1 --scheme splats_in_splats --set tau=1.5"
    assert attack.attack_options == options


def test_the_cost_of_an_attack_includes_the_jobs_that_measure_its_evidence(again):
    def measured(name):
        words = Variant(again, name).cost_options.split()
        return [word.rpartition("/")[2].removesuffix(".cost.json") for word in words[3:]]

    folder = "splats_in_splats/raised@1"
    assert Variant(again, "noise").cost_options == f"--cost results/benchmarks/{folder}/noise/attack.cost.json"
    assert measured("plain_weight") == ["1-of-1", "weights"]
    clustered = ["1-of-1", "weights", "opacities", "features", "tree", "clusters", "prune_mask"]
    assert measured("gspure") == clustered
    assert f"results/logs/{folder}/decisions/leaf/clusters.cost.json" in Variant(again, "leaf").cost_options
    assert f"results/logs/{folder}/tree.cost.json" in Variant(again, "leaf").cost_options


def test_a_variant_with_a_damage_gets_views_and_photographs(again, monkeypatch):
    monkeypatch.chdir(ROOT)
    variants = {**CONFIG["variants"], "plain_weight": {"decision": "mild", "damage": [0.3, 1]}}
    plan = plan_of(variants=variants)
    weak = Variant(replace(again, plan=plan), "plain_weight@0.3dB")
    assert weak.render_files == {"cameras": f"{again.folder}/cameras.json", "photographs": again.pair["scene"]}
    assert "--damage 0.3 --split test" in weak.attack_options
    assert "tau" not in weak.attack_options
    assert "photographs" not in Variant(Model(plan, "vanilla", "bot"), "plain_weight@1dB").render_files
    assert not Variant(again, "plain_weight").render_files


@pytest.mark.parametrize("name", ["finetune", "reestimate", "distil", "prune_repair"])
def test_an_attack_that_learns_gets_views_but_neither_photographs_nor_key_nor_message(again, monkeypatch, name):
    monkeypatch.chdir(ROOT)
    learning = Variant(replace(again, plan=plan_of(variants={**CONFIG["variants"], name: {}})), name)
    weights = {"weights": f"{again.folder}/weights.npy"} if name == "prune_repair" else {}
    assert {**learning.evidence, **learning.render_files} == {"cameras": f"{again.folder}/cameras.json"} | weights
    assert not any(word in learning.attack_options for word in ("photographs", "key", "message", "pairs"))


def test_scaled_gspure_thresholds_what_its_decision_does(again, monkeypatch):
    monkeypatch.chdir(ROOT)
    variants = {**CONFIG["variants"], "scaled": {"attack": "gspure_scaled", "decision": "blind", "scale": 0.5}}
    scaled = Variant(replace(again, plan=plan_of(variants=variants)), "scaled")
    clusters = f"{again.folder}/decisions/blind/clusters.npz"
    assert scaled.evidence == {"labels": clusters, "weights": f"{again.folder}/opacities.npy"}
    assert scaled.attack_options.endswith("--set tau_c=4.0 --set tau_n=4.0 --set scale=0.5")


def test_equal_decisions_share_artifacts_and_others_have_a_folder(again):
    same, leaf, blind = (Decision(again, name) for name in ("same", "leaf", "blind"))
    assert same.path("prune_mask.npy") == f"{again.folder}/prune_mask.npy"
    assert leaf.path("tree.npy") == f"{again.folder}/tree.npy"
    assert leaf.path("clusters.npz") == f"{again.folder}/decisions/leaf/clusters.npz"
    assert leaf.thresholded == f"{again.folder}/weights.npy"
    assert blind.thresholded == f"{again.folder}/opacities.npy"


def test_factors_that_are_null_suit_the_scheme(plan):
    factors = [Decision(Model(plan, name, "raised")).options("tau_c", "tau_n") for name in plan.schemes]
    assert factors == ["--tau-c 4.0 --tau-n 4.0", "--tau-c 3.0 --tau-n 2.0"]


def test_panels_begin_with_the_photographs_of_the_target(again, bot):
    assert list(again.panel_columns("message_oracle").items())[:2] == [
        ("truth", "results/pairs/raised/message"),
        ("unattacked", f"{again.folder}/unattacked/renders/message_oracle"),
    ]
    assert list(bot.panel_columns("scene")) == ["unattacked", "gspure"]


def test_a_condition_has_the_figure_of_a_sweep_if_a_factor_is_varied(plan):
    assert plan.condition_figures("secure_gs")["sweep"] == "--point gspure=2.0,3.0 --point mild=1.5,3.0"
    assert plan.condition_figures("vanilla") == {}
    assert "--sweep gspure=gspure,mild" in plan.sweep_options
    unvaried = plan_of(assets=None, decisions=None, variants={"unattacked": {}, "gspure": {}})
    assert "sweep" not in unvaried.condition_figures("secure_gs")


def test_hidden_bits_have_no_figure_of_a_trade_off_between_pictures():
    plan = plan_of(assets=None, schemes={"marked_clones": {}, "secure_gs": {}})
    assert [[*plan.condition_figures(name)] for name in plan.schemes] == [["sweep"], ["sweep", "tradeoff"]]


def test_tables_take_protocol_and_initialization_of_every_watermarked_model(plan):
    pairs = {"a": {}, "b": {"protocol": "own", "initialization": "scene"}}
    words = plan_of(pairs=pairs, schemes={"secure_gs": {}}, repetitions=1).condition_options.split()
    assert words == ["--condition", "secure_gs/a=shared,both", "--condition", "secure_gs/b=own,scene"]
    assert "vanilla" not in plan.condition_options


def test_pairs_with_one_message_of_photographs_share_its_model(plan):
    pair = {"message": "captures/b", "message_photographs": [], "iterations": 9, "resolution": "320px", "seed": 0}
    pairs = {"one": {**pair, "scene": "captures/a"}, "two": {**pair, "scene": "captures/c"}, "traced": {}}
    assert len(Plan({**plan.config, "pairs": pairs}).messages) == 1
