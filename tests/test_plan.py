"""The plan of a configuration: models, their jobs with files and settings, groups of variants, and what is refused."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gspure import codec
from gspure.cameras import write_cameras
from gspure.errors import InputError
from gspure.evaluation.identity import Condition
from gspure.evaluation.plan import METHOD, CameraSource, Control, Detector, ModelPlan, Plan, read_plan
from gspure.files import write_json
from gspure.images import write_image
from gspure.metrics.names import CLEAN, CONTROLS, OTHER_SCENE, WRONG_KEY
from gspure.metrics.targets import ADAPTIVE, BITS, MESSAGE, SCENE
from gspure.model import write_model
from gspure.workflow.decisions import ARTIFACTS, sharing_decision, suited
from gspure.workflow.inputs import capture_files, model_files
from tests.models import blobs, tilted_camera
from tests.training_cases import colmap_project, ring
from tests.workflow_cases import SOURCE, configuration, plan_of

EVERY: dict[str, dict[str, Any]] = {"unattacked": {}, "gspure": {}}
PAIR: dict[str, Any] = {"pairs": {"raised": {}}, "schemes": {"planted": {}}}
BOT = {"model": __file__, "cameras": "orbit"}
CONFIG = yaml.safe_load("""
assets: {bot: {model: bot.ply, cameras: orbit}}
pairs: {raised: {}, front: {message: room, placement: front}}
schemes: {splats_in_splats: {seed: 3, iterations: 60}, secure_gs: {}}
repetitions: 2
decisions: {same: {}, leaf: {selection: leaf}, blind: {cluster_on: [position, opacity]}, mild: {tau_n: 1.5}}
variants:
  unattacked: {}
  gspure: {}
  leaf: {attack: gspure, decision: leaf}
  plain_weight: {decision: mild}
  weak: {attack: plain_weight, decision: mild, damage: [0.3, 1]}
  scaled: {attack: gspure_scaled, decision: blind, scale: 0.5}
  strong: {attack: plain_weight, tau: 9}
  noise: {attack: gaussian_noise, sigma: 0.2, seed: 5}
  gof: {damage: 1}
  lowest_opacity: {}
  random_matched: {}
""")
FOLDER = Path("results/splats_in_splats/raised@1")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def capture(name: str) -> str:
    """Write photographs with their cameras."""
    colmap_project(Path(name), ring(9), [[0.1 * i, 0.0, 0.0] for i in range(9)])
    return name


def written_model(name: str) -> str:
    write_model(Path(name), blobs(4))
    return name


def written_asset(name: str = "mine.ply") -> dict[str, Any]:
    return {"model": written_model(name), "cameras": "orbit"}


def written_views(file: str, *, are_there: bool = True) -> str:
    """Write a view that names a photograph beside it."""
    image = Path(file).with_name("v.png").absolute()
    if are_there:
        write_image(image, np.zeros((6, 8, 3)))
    write_cameras(Path(file), [replace(tilted_camera(8, 6, name="v"), image=image)])
    return file


@pytest.fixture
def plan() -> Plan:
    written_model("bot.ply")
    return plan_of(CONFIG)


@pytest.fixture
def again(plan: Plan) -> ModelPlan:
    """A repetition of a scheme on a pair."""
    return plan.by_name["splats_in_splats/raised@1"]


@pytest.fixture
def marked() -> dict[str, Any]:
    """The entry of a user's marked model, whose photographs are not there."""
    provenance = {"settings": {"scheme": "splats_in_splats"}, "inputs": {"pair": {"path": "pair"}}}
    write_json(Path("key/provenance.json"), provenance)
    return {"model": written_model("marked.ply"), "cameras": written_views("views.json", are_there=False), "key": "key"}


def planned(**content: Any) -> Plan:
    return plan_of({**PAIR, **content})


def model_of(**content: Any) -> ModelPlan:
    """The first model of a pair."""
    return planned(**content).models[0]


def model_of_asset(entry: dict[str, Any]) -> ModelPlan:
    (model,) = plan_of({"assets": {"mine": entry}}).models
    return model


def controls(model: ModelPlan) -> list[str]:
    return [job.variant for job in model.controls]


def variant(name: str, **entries: Any) -> dict[str, Any]:
    return {"variants": {**EVERY, name: entries}, "decisions": {"mild": {}}}


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ({"pairs": {}}, "assets: expected at least one model, or a pair and a scheme, found none"),
        ({"pairs": {"a": {"scene": "no", "message": "no"}}}, "pairs.a.scene: .* file or folder, found no"),
        ({"pairs": {"a": {"scene": "data/bicycle", "message": "no"}}}, "pairs.a.scene: .*gspure download bicycle"),
        ({"pairs": {"a": {"scene": "room", "message": "photos"}}}, "pairs.a: "),
        ({"schemes": {"splats": {}}}, "schemes.splats: expected one of .*splats_in_splats.*, found 'splats'"),
        ({"schemes": {"planted": {"bits": 3}}}, "schemes.planted.bits: expected one of .*unknown key"),
        ({"extractions": ["message", "message_x"]}, "extractions: expected one of message.*'message_x'"),
        ({"assets": {"bot": {**BOT, "model": "no.ply"}}}, "assets.bot.model: expected .* found no.ply"),
        ({"assets": {"bot": {**BOT, "cameras": "no.json"}}}, "assets.bot.cameras: .* found no.json"),
        ({"assets": {"bot": {**BOT, "clean": "bot"}}}, "assets.bot.clean: "),
        ({"assets": {"a": {**BOT, "clean": "b"}, "b": {**BOT, "clean": "c"}, "c": BOT}}, "assets.a.clean: "),
        ({"assets": {"desk": {"train": "desk"}}}, "assets.desk.train: "),
        (variant("clean", attack="crop"), "variants.clean: expected a name of no control"),
        (variant("crop", attack="gof"), "variants.crop: "),
        (variant("crop", fraction=2), "variants.crop.fraction: expected a number from 0 to 1"),
        (variant("crop", damage=1, fraction=0.5), "variants.crop.fraction: "),
        (variant("crop", damage=1, until="gone"), "variants.crop.until: expected nothing beside damage, found gone"),
        (variant("crop", decision="mild"), "variants.crop.decision: "),
        (variant("gspure", decision="wild"), "variants.gspure.decision: expected one of mild, found 'wild'"),
        (variant("gspure", damage=1), "variants.gspure.damage: expected an attack with a strength, found gspure"),
        ({"detectors": {"scene": {"command": "read"}}}, "detectors.scene: "),
        ({"detectors": {"blue": {}}}, "detectors.blue: expected one of green, found 'blue'"),
        ({"detectors": {"mark": {"command": "read 'image"}}}, "detectors.mark: "),
    ],
    ids=str,
)
def test_what_no_job_could_use_is_refused_in_one_line(content: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=f"^{SOURCE}: {line}") as refusal:
        planned(**content)
    assert "\n" not in str(refusal.value)


def test_there_is_a_model_of_each_asset_and_of_each_scheme_pair_and_repetition(plan: Plan) -> None:
    scenes = ["raised", "raised@1", "front", "front@1"]
    schemes = ["splats_in_splats", "secure_gs"]
    expected = ["results/vanilla/bot", *(f"results/{scheme}/{scene}" for scheme in schemes for scene in scenes)]
    assert [str(model.folder) for model in plan.models] == expected


def test_a_repetition_has_the_pair_and_its_number_in_the_seeds_of_training_and_attacks(plan: Plan) -> None:
    models = [plan.by_name[f"splats_in_splats/raised{suffix}"] for suffix in ("", "@1")]
    embeddings = [model.embedding for model in models if model.embedding]
    assert [embedding.seed for embedding in embeddings] == [3, 4]
    assert [model.by_variant["noise"].case.seed for model in models] == [5, 6]
    assert {embedding.pair for embedding in embeddings} == {Path("results/pairs/raised")}
    assert (embeddings[1].initialization, embeddings[1].settings) == ("both", {"iterations": 60})


def test_a_users_model_is_read_in_place_and_compared_with_its_renders(plan: Plan) -> None:
    bot = plan.by_name["vanilla/bot"]
    assert bot.public == bot.users_files[0] == Path("bot.ply")
    assert (bot.inputs, bot.camera_files, bot.targets, bot.controls, bot.owner) == ((), (), (SCENE,), (), None)
    job = bot.by_variant["gspure"]
    assert (job.views.unattacked, job.views.photographed) == (Path("results/vanilla/bot/unattacked/renders"), ())
    assert job.views.split == "test"
    assert job.views.unattacked in job.inputs
    assert job.views.unattacked not in bot.by_variant["unattacked"].inputs
    assert Path("bot.ply") not in job.inputs
    assert Path("bot.ply") in job.users_files


def test_a_model_depends_on_the_code_of_its_scheme_or_of_all_that_columns_may_tell(plan: Plan) -> None:
    code = {model.id.scheme: {*model.modules} for model in plan.models}
    of_secure_gs = {"gspure_torch.secure_gs", "gspure_torch.secure_gs.model", "gspure_torch.secure_gs.key"}
    assert code["secure_gs"] == of_secure_gs
    assert code["vanilla"] > {"gspure.public_model", "gspure_torch.gs_hider.model"} | of_secure_gs
    assert "gspure_torch.gs_hider.model" not in code["splats_in_splats"]


def test_generated_views_are_those_of_their_settings() -> None:
    generated = {"count": 5, "fov": 60, "up": [0, 0, 1]}
    entry = {**written_asset(), "cameras": "shells", "resolution": "64px", "generated": generated}
    expected = {"count": 5, "width": 640, "height": 480, "fov_degrees": 60.0, "up": [0.0, 0.0, 1.0]}
    assert model_of_asset(entry).cameras[SCENE] == CameraSource("shells", "native", expected)


def test_the_newest_model_of_a_training_run_is_read_with_the_files_of_the_run() -> None:
    for iteration in (7, 30):
        written_model(f"runs/bot/point_cloud/iteration_{iteration}/point_cloud.ply")
    for folder in ("runs", "runs/bot", "runs/bot/point_cloud"):
        Path(folder, "cfg_args").touch()
    model = model_of_asset({"model": "runs/bot", "cameras": "orbit"})
    assert model.public == Path("runs/bot/point_cloud/iteration_30/point_cloud.ply")
    assert model.users_files == (model.public, Path("runs/bot/cfg_args"))
    assert {*model.users_files} <= {*model.by_variant["gspure"].users_files}


def test_beside_a_model_or_a_capture_lie_files_that_are_read_with_it() -> None:
    for name in ("meta.json", "means.webp", "other.ply", "points3D.ply"):
        Path(name).touch()
    assert model_files("meta.json") == (Path("meta.json"), Path("means.webp"))
    assert model_files("other.ply") == (Path("other.ply"),)
    views = written_views("photos/views.json")
    Path("photos/points3D.ply").touch()
    assert capture_files(views) == (Path(views), Path("photos/points3D.ply"), Path("photos/v.png"))


def test_a_key_names_the_scheme_of_a_users_model(marked: dict[str, Any]) -> None:
    model = model_of_asset(marked)
    assert str(model.folder) == "results/splats_in_splats/mine"
    owner = model.owner
    assert (model.public, owner.key) == (Path("marked.ply"), Path("key"))
    assert (owner.candidates, owner.twins) == (None, 8)
    assert {Path("marked.ply"), Path("key/provenance.json")} <= {*model.users_files}
    assert controls(model) == [WRONG_KEY]
    assert {source.source for source in model.cameras.values()} == {"views.json"}
    assert model.by_variant["gspure"].views.photographed == ()


def test_a_key_of_unknown_origin_needs_the_name_of_its_scheme(marked: dict[str, Any]) -> None:
    Path("key/provenance.json").unlink()
    with pytest.raises(InputError, match=r"found no provenance\.json in it"):
        model_of_asset(marked)
    model = model_of_asset({**marked, "scheme": "planted"})
    assert model.id.scheme == "planted"
    assert model.folder / "message_cameras.json" in model.by_variant["gspure"].inputs
    owner = model.owner
    assert (owner.bit_targets, owner.reveals, owner.photographs) == ((), True, None)


def test_a_model_is_compared_with_the_photographs_of_its_views(marked: dict[str, Any]) -> None:
    entry = {**marked, "cameras": written_views("views.json"), "message": written_views("message/views.json")}
    model = model_of_asset(entry)
    assert model.by_variant["gspure"].views.photographed == (SCENE, MESSAGE)
    message = CameraSource("message/views.json", "photographs")
    assert model.cameras == {SCENE: CameraSource("views.json", "1600px"), MESSAGE: message}
    assert {Path("v.png"), Path("message/v.png")} <= {*model.users_files}
    unmarked = model_of_asset({"model": "marked.ply", "cameras": "views.json"})
    assert unmarked.camera_files == (Path("views.json"),)
    assert unmarked.by_variant["gspure"].views.photographed == (SCENE,)


def test_a_model_of_photographs_is_trained_first_and_a_missing_photograph_is_named() -> None:
    garden = {"train": capture("garden"), "training": {"seed": 2}}
    assets = {"garden": garden, "marked": {**written_asset(), "clean": "garden"}}
    plan = plan_of({"assets": assets})
    model, marked = plan.models
    assert model.inputs == (model.public,) == (model.folder / "public" / "point_cloud.ply",)
    assert model.camera_inputs == (model.folder / "trained" / "cameras.json",)
    assert model.public in model.by_variant["gspure"].inputs
    control = marked.by_variant[CLEAN]
    assert control.public == model.public in control.inputs
    assert (control.rendered, control.compared) == ((SCENE,), (SCENE,))
    training = plan.trained["garden"]
    assert (training.sources, training.options["seed"], training.options["max_gaussians"]) == (("garden",), 2, None)
    photographs = [file for file in training.users_files if file.suffix == ".png"]
    assert len(photographs) == 9
    assert all(image.is_file() and not image.is_absolute() for image in photographs)
    photographs[0].unlink()
    with pytest.raises(InputError, match=photographs[0].name):
        plan_of({"assets": assets})


def test_detectors_read_all_models_but_the_clean_asset_of_another_and_of_controls_the_clean_model() -> None:
    Path("mark.py").touch()
    assets = {"marked": {**written_asset(), "clean": "room"}, "room": written_asset("room.ply")}
    detectors = {"mark": {"command": "python3 mark.py", "message": "01", "timeout": 3, "reads": "model"}}
    plan = planned(assets=assets, detectors=detectors, pairs={"room": {}})
    marked, clean, pair = plan.models
    expected = {"mark": Detector("python3 mark.py", "01", 3.0, "model")}
    assert marked.by_variant["gspure"].detectors == pair.by_variant["gspure"].detectors == expected
    assert all(not job.detectors and Path("mark.py") not in job.users_files for job in clean.jobs)
    assert (controls(marked), controls(pair)) == ([CLEAN], [CLEAN, WRONG_KEY])
    of_plugin = planned(assets={"room": written_asset("room.ply")}, detectors={"green": {"timeout": 5}})
    assert of_plugin.models[0].by_variant["gspure"].detectors == {"green": Detector("python3 green.py", timeout=5.0)}
    assert [job.variant for job in (*marked.controls, *pair.controls) if job.detectors] == [CLEAN, CLEAN]
    control = marked.by_variant[CLEAN]
    assert (control.public, control.detectors) == (Path("room.ply"), expected)
    assert {Path("room.ply"), Path("mark.py")} <= {*control.users_files}
    assert Path("room.ply") not in control.inputs


def test_of_hidden_bits_only_variants_and_the_clean_model_are_compared() -> None:
    model = model_of(pairs=CONFIG["pairs"], schemes={"marked_clones": {}})
    jobs = {job.variant: (job.compared, job.bit_targets) for job in (model.by_variant["gspure"], *model.controls)}
    expected = {"gspure": ((SCENE,), (BITS,)), CLEAN: ((SCENE,), (BITS,))}
    assert jobs == {**expected, WRONG_KEY: ((), (BITS,)), OTHER_SCENE: ((), (BITS,))}
    owner = model.owner
    assert (owner.bit_targets, owner.reveals, owner.candidates) == ((BITS,), False, None)


@pytest.mark.parametrize(
    ("pair", "users_files"),
    [
        ({"scene": "room", "message": "object-3"}, []),
        ({"scene": "scene", "message": "photos", "protocol": "own"}, ["scene", "photos"]),
        ({"scene": "scene", "message": "message.ply"}, ["scene", "message.ply"]),
    ],
    ids=str,
)
def test_a_pair_is_made_from_traced_scenes_photographs_or_a_model(pair: dict[str, str], users_files: list[str]) -> None:
    for name in ("scene", "photos"):
        capture(name)
    written_model("message.ply")
    plan = planned(pairs={"mine": pair})
    training = plan.pairs["mine"]
    assert (training.sources, training.inputs, plan.messages) == ((pair["scene"], pair["message"]), (), {})
    assert {file.parts[0] for file in training.users_files} == {*users_files}
    assert plan.models[0].condition == Condition("planted", pair.get("protocol", "shared"), "both")


@pytest.mark.parametrize(("width", "is_small"), [(256, True), (257, False)])
def test_a_traced_pair_has_the_size_of_its_settings(*, width: int, is_small: bool) -> None:
    size = {"views": 3, "width": width, "height": 256, "seed": 4}
    plan = planned(pairs={"mine": size})
    training = plan.pairs["mine"]
    assert training.options == {"protocol": "shared", "placement": "raised", **size}
    assert training.has_small_images is plan.models[0].has_small_images is is_small


def test_a_pair_of_photographs_trains_a_model_of_its_message_or_shares_it() -> None:
    pair = {"scene": capture("scene"), "message": capture("photos/message"), "iterations": 7, "width": 16}
    plan = planned(pairs={"mine": pair, "same": pair, "longer": {**pair, "iterations": 8}})
    (name, message), _ = plan.messages.items()
    assert name.startswith("message-")
    assert {model.owner.candidates for model in plan.models} == {None}
    assert message.sources == ("photos/message",)
    assert message.options == {"iterations": 7, "resolution": "320px", "seed": 0}
    assert len([file for file in message.users_files if file.match("photos/message/images/*.png")]) == 9
    training = plan.pairs["mine"]
    trained = Path("results/messages") / name
    assert (training.sources, training.inputs) == (("scene", str(trained)), (trained,))
    assert training.options == {"protocol": "shared", "resolution": "320px", "seed": 0}
    assert {file.parts[0] for file in training.users_files} == {"scene"}
    assert not training.has_small_images


def test_chosen_extractions_are_compared_and_an_adaptive_owner_has_what_the_scheme_uses() -> None:
    schemes: dict[str, Any] = {"splats_in_splats": {}, "gs_hider": {}}
    fixed, fitted = planned(schemes=schemes).models
    assert fixed.targets == (SCENE, MESSAGE, ADAPTIVE)
    assert fixed.owner.published_model == fixed.public
    photographs = [model.owner.photographs for model in (fixed, fitted)]
    assert photographs == [None, Path("results/pairs/raised/message")]
    fixed, fitted = planned(schemes=schemes, extractions=[MESSAGE]).models
    assert fixed.targets == (SCENE, MESSAGE)
    assert fixed.owner.published_model is fitted.owner.published_model is fitted.owner.photographs is None


def test_another_scenes_model_is_a_control_only_if_it_hides_another_message(again: ModelPlan) -> None:
    other = again.by_variant[OTHER_SCENE]
    assert other.public == Path("results/splats_in_splats/front/public/point_cloud.ply")
    assert other.public in other.inputs
    alike = model_of(pairs={"raised": {}, "front": {"placement": "front"}})
    assert controls(alike) == [name for name in CONTROLS if name != OTHER_SCENE]


def test_controls_of_a_marked_model_render_its_message_alone(again: ModelPlan) -> None:
    message = again.targets[1:]
    expected = {CLEAN: (again.targets, again.targets), WRONG_KEY: (message, message), OTHER_SCENE: (message, message)}
    assert {job.variant: (job.rendered, job.compared) for job in again.controls} == expected
    clean = again.by_variant[CLEAN]
    assert (clean.case, clean.public) == (Control(CLEAN), FOLDER / "clean/public/point_cloud.ply")
    assert clean.public in clean.inputs
    (many,) = planned(pairs={"raised": {}}, schemes={"keyss": {"clean_models": 3}}).models
    assert controls(many) == [CLEAN, "clean_2", "clean_3", WRONG_KEY]
    assert many.by_variant["clean_3"].public == many.folder / "clean_3/public/point_cloud.ply"


@pytest.mark.parametrize("split", ["test", "all"])
def test_pairs_of_one_kind_share_a_file_of_candidates_in_the_compared_views(split: str) -> None:
    other = {"message": "object-3", "views": 9}
    pairs = {"a": {}, "b": {"scene": "landscape-1", "message": "interior-5", "seed": 2}, "c": other, "d": other}
    plan = planned(pairs=pairs, proof={"candidates": 19, "twins": 2}, views={"evaluate": split})
    names = [f"interior-raised-160x120x32-{split}-19", f"object-raised-160x120x9-{split}-19"]
    assert [*plan.candidates] == names
    files = [Path(f"results/candidates/{name}.npy") for name in names]
    assert [model.owner.candidates for model in plan.models] == [files[0], files[0], files[1], files[1]]
    assert all(model.owner.twins == 2 for model in plan.models)
    assert files[0] in plan.models[0].by_variant["gspure"].inputs
    assert planned(pairs=pairs, proof={"candidates": 0}).candidates == {}


def test_measurements_are_the_files_of_their_steps(again: ModelPlan) -> None:
    mask = {"prune_mask": FOLDER / "prune_mask.npy"}
    weights = {"weights": FOLDER / "weights.npy"}
    assert {job.variant: job.case.measured for job in again.variants} == {
        "unattacked": {},
        "noise": {},
        **dict.fromkeys(("gspure", "random_matched"), mask),
        **dict.fromkeys(("plain_weight", "strong", "weak@0.3dB", "weak@1dB"), weights),
        "leaf": {"prune_mask": FOLDER / "decisions/leaf/prune_mask.npy"},
        "scaled": {"labels": FOLDER / "decisions/blind/clusters.npz", "weights": FOLDER / "opacities.npy"},
        "gof@1dB": {"surface": FOLDER / "surface.npy"},
        "lowest_opacity": {"opacities": FOLDER / "opacities.npy"},
    }
    assert FOLDER / "weights.npy" in again.by_variant["plain_weight"].inputs
    assert [job.variant for job in again.variants] == sorted(job.variant for job in again.variants)


def test_an_attack_takes_the_factors_of_its_decision_unless_it_has_its_own_or_they_are_searched(plan: Plan) -> None:
    model = plan.by_name["splats_in_splats/raised"]
    names = ("gspure", "plain_weight", "strong", "scaled")
    assert {name: model.by_variant[name].case.settings for name in names} == {
        "gspure": {},
        "plain_weight": {"tau": 1.5},
        "strong": {"tau": 9},
        "scaled": {"tau_c": 4.0, "tau_n": 4.0, "scale": 0.5},
    }
    weak = model.by_variant["weak@0.3dB"].case
    assert (weak.name, weak.entry, weak.settings, weak.damage) == ("plain_weight", "weak", {}, 0.3)
    suited_to_scheme = {"tau_c": 3.0, "tau_n": 2.0, "scale": 0.5}
    assert plan.by_name["secure_gs/raised"].by_variant["scaled"].case.settings == suited_to_scheme


@pytest.mark.parametrize(
    ("setting", "value", "first"),
    [("energy", "ewa", "contributions"), ("min_samples", 7, "tree.npy"), ("tau_n", 9.0, "prune_mask.npy")],
)
def test_decisions_share_artifacts_before_their_first_difference(setting: str, value: object, first: str) -> None:
    config = configuration({"decisions": {"changed": {setting: value}}})
    settings = suited({METHOD: config.method, **config.decisions}, 3.0, 2.0)
    shared = [artifact for artifact in ARTIFACTS if sharing_decision(settings, "changed", artifact) == METHOD]
    assert shared == [*ARTIFACTS][: [*ARTIFACTS].index(first)]


def deciding(**decisions: dict[str, Any]) -> dict[str, Any]:
    """Decisions, and a variant of GSPure for each of them."""
    variants = {name: {"attack": "gspure", "decision": name} for name in decisions}
    return {"decisions": decisions, "variants": {**variants, **EVERY}}


def test_a_sweep_is_one_attack_at_several_strengths_and_nothing_else() -> None:
    content = deciding(gentle={"tau_n": 9}, leaf={"selection": "leaf"}, gentle_leaf={"selection": "leaf", "tau_c": 9})
    content["variants"] |= {"half": {"attack": "random_pruning", "fraction": 0.5}, "random_pruning": {}}
    content["variants"] |= {"gspure_scaled": {"damage": [0.3, 2]}, "plain_weight": {}, "crop": {"seed": 1}}
    content["variants"] |= {"wide": {"attack": "crop", "fraction": 0.9}, "narrow": {"attack": "crop", "fraction": 0.4}}
    plan = planned(schemes={"secure_gs": {}}, **content)
    sweeps = {
        "gspure": ("gentle", "gspure", "gspure_scaled@0.3dB", "gspure_scaled@2dB"),
        "gspure leaf": ("gentle_leaf", "leaf"),
        "random_pruning": ("half", "random_pruning"),
    }
    crops = ("narrow", "wide")
    assert plan.sweeps == {**sweeps, "crop sweep": crops}  # `crop` is a variant at another seed
    single = {"unattacked": ("unattacked",), "plain_weight": ("plain_weight",), "crop seed 1": ("crop",)}
    assert plan.attacks == {**sweeps, **single, "crop": crops}
    assert plan.factors["secure_gs"] == {"gspure": (2.0, 3.0), "gentle": (9.0, 3.0)}


def test_factors_are_listed_from_those_of_gspure_on_where_one_changes_alone() -> None:
    alone = deciding(noise={"tau_n": 2}, clusters={"tau_c": 2}, leaf={"selection": "leaf", "tau_n": 2})
    factors = planned(**alone).factors["planted"]
    assert [*factors.items()] == [("gspure", (4.0, 4.0)), ("clusters", (4.0, 2.0)), ("noise", (2.0, 4.0))]
    assert planned(**deciding(both={"tau_n": 2, "tau_c": 2})).factors == {}


def test_a_plan_is_read_back_from_its_file_and_from_one_line() -> None:
    schemes: dict[str, Any] = {"planted": {}, "secure_gs": {}, "marked_clones": {}}
    detectors = {"mark": {"command": "read", "message": "0110"}}
    plan = plan_of({**CONFIG, "assets": {"bot": written_asset()}, "schemes": schemes, "detectors": detectors})
    write_json(Path("results/plan.json"), codec.plain(plan))
    copy = read_plan(Path("results"))
    assert copy == plan
    assert [*copy.schemes] == [*schemes]
    assert "planted/raised@1" in copy.by_name
    assert copy.meanings["gspure"] == "Remove the rows that GSPure decided on."
    assert repr(codec.read(Plan, json.loads(codec.text(plan)), "plan.json")) == repr(plan)
    with pytest.raises(InputError, match=r"plan\.json"):
        read_plan(Path())
