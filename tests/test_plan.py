"""The plan of a run: models, their jobs with files and settings, decisions, and the groups of variants."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from gspure.cameras import write_cameras
from gspure.errors import InputError
from gspure.evaluation.plan import METHOD, AttackSpec, CameraSource, Control, ModelPlan, Plan
from gspure.files import write_json
from gspure.images import write_image
from gspure.metrics.names import BASELINES, CLEAN_GSPURE, CONTROLS, OTHER_SCENE
from gspure.model import write_model
from gspure.workflow.decisions import ARTIFACTS, sharing_decision, suited
from tests.models import blobs, tilted_camera
from tests.workflow_cases import ROOT, configuration, plan_of

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
FOLDER = Path("results/splats_in_splats/raised@1")


def changed(**changes) -> Plan:
    return plan_of({name: value for name, value in {**CONFIG, **changes}.items() if value is not None})


@pytest.fixture(scope="module")
def plan() -> Plan:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        return changed()


@pytest.fixture
def bot(plan) -> ModelPlan:
    return plan.by_name["vanilla/bot"]


@pytest.fixture
def again(plan) -> ModelPlan:
    """A repetition of a scheme on a pair."""
    return plan.by_name["splats_in_splats/raised@1"]


def attack(model: ModelPlan, variant: str) -> AttackSpec:
    case = model.by_variant[variant].case
    assert isinstance(case, AttackSpec)
    return case


def controls(model: ModelPlan) -> list[str]:
    return [job.variant for job in model.controls]


def test_there_is_a_model_of_each_asset_and_of_each_scheme_pair_and_repetition(plan):
    scenes = ["raised", "raised@1", "front", "front@1"]
    schemes = ["splats_in_splats", "secure_gs"]
    expected = ["results/vanilla/bot", *(f"results/{scheme}/{scene}" for scheme in schemes for scene in scenes)]
    assert [str(model.folder) for model in plan.models] == expected


def test_a_repetition_has_the_pair_and_other_seeds(again):
    embedding = again.embedding
    assert (embedding.pair, embedding.seed) == (Path("results/pairs/raised"), 4)
    assert (embedding.initialization, embedding.settings) == ("both", {"iterations": 60})
    assert attack(again, "noise").seed == 6


def test_a_users_model_is_read_in_place_and_compared_with_its_renders(bot):
    assert bot.public == bot.users_files[0] == Path("README.md")
    assert (bot.inputs, bot.camera_files, bot.targets, bot.controls, bot.owner) == ((), (), ("scene",), (), None)
    assert bot.cameras["scene"].generated["count"] == 24
    job = bot.by_variant["gspure"]
    assert (job.views.unattacked, job.views.photographed) == (Path("results/vanilla/bot/unattacked/renders"), ())
    assert job.views.unattacked in job.inputs
    assert job.views.unattacked not in bot.by_variant["unattacked"].inputs
    assert Path("README.md") not in job.inputs
    assert Path("README.md") in job.users_files


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
    assert str(model.folder) == "results/splats_in_splats/mine"
    assert (model.public, model.owner.key) == (Path("marked.ply"), Path("key"))
    assert {Path("marked.ply"), Path("key/provenance.json")} <= {*model.users_files}
    assert controls(model) == ["wrong_key", "black", "mean_colour"]
    assert {source.source for source in model.cameras.values()} == {"views.json"}
    job = model.by_variant["gspure"]
    assert job.views.photographed == ()
    assert job.owner.decoys == (model.folder / "unattacked" / "renders" / "scene",)


def test_photographs_of_message_and_scene_are_what_a_users_model_is_compared_with(marked, tmp_path):
    for folder in (tmp_path, tmp_path / "message"):
        write_image(folder / "v.png", np.zeros((6, 8, 3)))
        write_cameras(folder / "views.json", [replace(tilted_camera(8, 6, name="v"), image=folder / "v.png")])
    (model,) = changed(assets={"mine": marked | {"message": "message/views.json"}}, pairs=None, schemes=None).models
    assert model.by_variant["gspure"].views.photographed == ("scene", "message")
    assert model.cameras == {
        "scene": CameraSource("views.json", "1600px"),
        "message": CameraSource("message/views.json", "photographs"),
    }
    assert tmp_path / "message" / "v.png" in {file.resolve() for file in model.users_files}


def test_a_key_of_unknown_origin_needs_the_name_of_its_scheme(marked, tmp_path):
    (tmp_path / "key" / "provenance.json").unlink()
    with pytest.raises(InputError, match=r"key/provenance\.json: no such file"):
        changed(assets={"mine": marked}, pairs=None, schemes=None)
    (model,) = changed(assets={"mine": marked | {"scheme": "keyss"}}, pairs=None, schemes=None).models
    assert model.id.scheme == "keyss"


def test_detectors_read_a_model_but_not_the_clean_model_of_another(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mark.py").touch()
    assets = {}
    for name in ("marked", "clean"):
        write_model(tmp_path / f"{name}.ply", blobs(4))
        assets[name] = {"model": f"{name}.ply", "cameras": "orbit"}
    assets["marked"]["clean"] = "clean"
    detectors = {"mark": {"command": "python3 mark.py"}}
    plan = changed(assets=assets, pairs=None, schemes=None, detectors=detectors)
    marked, clean = plan.models
    assert controls(marked) == ["clean"]
    control = marked.by_variant["clean"]
    assert (control.public, [*control.detectors]) == (Path("clean.ply"), ["mark"])
    assert {Path("clean.ply"), Path("mark.py")} <= {*control.users_files}
    assert Path("clean.ply") not in control.inputs
    assert [*marked.by_variant["gspure"].detectors] == ["mark"]
    assert all(not job.detectors and Path("mark.py") not in job.users_files for job in clean.jobs)


def test_a_model_of_photographs_is_trained_first(tmp_path, monkeypatch):
    from tests.training_cases import colmap_project, ring

    monkeypatch.chdir(tmp_path)
    colmap_project(Path("garden"), ring(9), [[0.1 * i, 0.0, 0.0] for i in range(9)])
    plan = changed(assets={"garden": {"train": "garden", "training": {"seed": 2}}}, pairs=None, schemes=None)
    (model,) = plan.models
    assert model.inputs == (model.public,) == (model.folder / "public" / "point_cloud.ply",)
    assert model.camera_inputs == (model.folder / "trained" / "cameras.json",)
    assert model.public in model.by_variant["gspure"].inputs
    training = plan.trained["garden"]
    assert (training.sources, training.options["seed"], training.options["max_gaussians"]) == (("garden",), 2, None)
    assert len([file for file in training.users_files if file.suffix == ".png"]) == 9


def test_chosen_extractions_are_those_that_are_compared(again):
    assert again.targets == ("scene", "message", "message_adaptive", "message_oracle")
    assert again.owner.published == again.public
    chosen = changed(assets=None, extractions=["message", "message_oracle"]).models[0]
    assert chosen.targets == ("scene", "message", "message_oracle")
    assert chosen.owner.published is None


def test_another_scenes_model_is_a_control_only_if_it_hides_another_message(again):
    assert controls(again) == [name for name in CONTROLS if name != CLEAN_GSPURE]
    other = again.by_variant[OTHER_SCENE]
    assert other.public == Path("results/splats_in_splats/front/public/point_cloud.ply")
    assert other.public in other.inputs
    alike = changed(assets=None, pairs={"raised": {}, "front": {"placement": "front"}}).models[0]
    assert controls(alike) == [name for name in controls(again) if name != OTHER_SCENE]


def test_gspure_prunes_the_clean_model_where_attacks_are_compared_at_equal_damage():
    searched = changed(assets=None, variants={"unattacked": {}, "gspure": {}, "gof": {"damage": 1}}).models[0]
    assert controls(searched) == list(CONTROLS)
    purified = searched.by_variant[CLEAN_GSPURE]
    clean = searched.folder / "clean" / "public" / "point_cloud.ply"
    assert purified.public == searched.by_variant["clean"].public == clean
    assert clean in purified.inputs
    assert purified.compared == ("scene",)
    assert purified.case == Control(CLEAN_GSPURE, searched.method.settings)


def test_controls_render_what_they_are_compared_in(again):
    message = again.targets[1:]
    expected = {
        "clean": (again.targets, again.targets),
        "wrong_key": (message, message),
        OTHER_SCENE: (message, message),
    }
    expected |= dict.fromkeys(BASELINES, ((), again.targets))
    assert {job.variant: (job.rendered, job.compared) for job in again.controls} == expected


def test_of_hidden_bits_only_variants_and_the_clean_model_are_compared():
    model = changed(assets=None, schemes={"marked_clones": {}}, repetitions=1).models[0]
    assert controls(model) == ["clean", "wrong_key", "other_scene"]
    compared = {name: model.by_variant[name].compared for name in ("gspure", *controls(model))}
    assert compared == {"gspure": ("scene",), "clean": ("scene",), "wrong_key": (), "other_scene": ()}
    assert all(model.by_variant[name].reads_bits for name in ("gspure", *controls(model)))
    assert (model.owner.hides, model.owner.reveals, model.owner.decoys) == ("bits", False, ())


def test_decoys_are_the_scene_other_messages_and_random_scenes(again):
    scene, message, *random = map(str, again.owner.decoys)
    assert (scene, message) == ("results/pairs/raised/scene", "results/pairs/front/message")
    assert random[0] == "results/decoys/160x120x4/9000"
    assert len(random) == 10
    assert {*again.owner.decoys} <= {*again.by_variant["gspure"].inputs}


def test_a_search_for_a_damage_sets_no_strength(monkeypatch):
    monkeypatch.chdir(ROOT)
    plan = changed(variants={**CONFIG["variants"], "plain_weight": {"decision": "mild", "damage": [0.3, 1]}})
    weak = attack(plan.by_name["splats_in_splats/raised@1"], "plain_weight@0.3dB")
    assert (weak.seed, weak.settings, weak.damage, weak.entry) == (1, {}, 0.3, "plain_weight")


def test_an_attack_takes_what_is_measured_and_the_factors_of_its_decision(again, monkeypatch):
    assert attack(again, "leaf").measured == {"prune_mask": FOLDER / "decisions" / "leaf" / "prune_mask.npy"}
    plain = attack(again, "plain_weight")
    assert (plain.measured, plain.settings) == ({"weights": FOLDER / "weights.npy"}, {"tau": 1.5})
    assert FOLDER / "weights.npy" in again.by_variant["plain_weight"].inputs
    monkeypatch.chdir(ROOT)
    scaled = {"attack": "gspure_scaled", "decision": "blind", "scale": 0.5}
    plan = changed(variants={**CONFIG["variants"], "scaled": scaled})
    spec = attack(plan.by_name["splats_in_splats/raised@1"], "scaled")
    assert spec.measured == {
        "labels": FOLDER / "decisions" / "blind" / "clusters.npz",
        "weights": FOLDER / "opacities.npy",
    }
    assert spec.settings == {"tau_c": 4.0, "tau_n": 4.0, "scale": 0.5}


def test_factors_that_are_null_suit_the_scheme(plan):
    models = [plan.by_name[f"{scheme}/raised"] for scheme in plan.schemes]
    factors = [(model.method.settings.tau_c, model.method.settings.tau_n) for model in models]
    assert factors == [(4.0, 4.0), (3.0, 2.0)]


@pytest.mark.parametrize(
    ("setting", "value", "first"),
    [("energy", "ewa", "contributions"), ("min_samples", 7, "tree.npy"), ("tau_n", 9.0, "prune_mask.npy")],
)
def test_decisions_share_the_artifacts_before_the_first_setting_in_which_they_differ(setting, value, first):
    config = configuration({"decisions": {"changed": {setting: value}}})
    settings = suited({METHOD: config.method, **config.decisions}, 3.0, 2.0)
    shared = [artifact for artifact in ARTIFACTS if sharing_decision(settings, "changed", artifact) == METHOD]
    assert shared == [*ARTIFACTS][: [*ARTIFACTS].index(first)]


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
    decisions = {
        "gentle": {"tau_n": 9},
        "leaf": {"selection": "leaf"},
        "gentle_leaf": {"selection": "leaf", "tau_c": 9},
    }
    plan = changed(assets=None, decisions=decisions, variants=variants)
    assert plan.sweeps == {
        "gspure": ("gentle", "gspure", "gspure_scaled@0.3dB", "gspure_scaled@2dB"),
        "gspure leaf": ("gentle_leaf", "leaf"),
        "random_pruning": ("half", "random_pruning"),
    }
    assert plan.attacks == {**plan.sweeps, "unattacked": ("unattacked",), "plain_weight": ("plain_weight",)}
    assert plan.factors["secure_gs"] == {"gspure": (2.0, 3.0), "gentle": (9.0, 3.0)}
    assert plan.meanings["half"].startswith("Remove")
