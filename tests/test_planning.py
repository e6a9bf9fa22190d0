"""From a configuration to jobs: pairs, the user's models and their files, groups of variants, refusals."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gspure.cameras import write_cameras
from gspure.codec import plain
from gspure.errors import InputError
from gspure.evaluation.identity import Condition
from gspure.evaluation.plan import PLAN, AttackSpec, Detector, ModelPlan, Owner, Plan, read_plan
from gspure.files import write_json
from gspure.images import write_image
from gspure.metrics.names import BLACK, CLEAN, CLEAN_GSPURE, WRONG_KEY
from gspure.metrics.targets import MESSAGE, SCENE
from gspure.model import write_model
from gspure.workflow.config import DetectorConfig
from gspure.workflow.inputs import capture_files, model_files
from tests.models import blobs, tilted_camera
from tests.training_cases import colmap_project, ring
from tests.workflow_cases import plan_of

EVERY: dict[str, dict[str, Any]] = {"unattacked": {}, "gspure": {}}
PAIR = {"pairs": {"raised": {}}, "schemes": {"planted": {}}}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def capture(name: str) -> str:
    """Write photographs with their cameras."""
    colmap_project(Path(name), ring(9), [[0.1 * i, 0.0, 0.0] for i in range(9)])
    return name


def written_model(name: str) -> str:
    write_model(Path(name), blobs(4))
    return name


def planned(*, pair: Mapping[str, Any] | None = None, **content: Any) -> Plan:
    pairs = {"mine": pair} if pair is not None else PAIR["pairs"]
    return plan_of({"pairs": pairs, "schemes": PAIR["schemes"], **content})


def only_model(plan: Plan) -> ModelPlan:
    (model,) = plan.models
    return model


def spec(model: ModelPlan, variant: str) -> AttackSpec:
    case = model.by_variant[variant].case
    assert isinstance(case, AttackSpec)
    return case


def refused_at(content: Mapping[str, Any]) -> str:
    with pytest.raises(InputError) as refusal:
        plan_of(content)
    assert refusal.value.source == "mine.yaml"
    return refusal.value.field


@pytest.mark.parametrize("content", [{}, {"pairs": {"a": {}}}, {"schemes": {"planted": {}}}], ids=str)
def test_a_plan_needs_a_model_or_a_pair_and_a_scheme(content: dict[str, Any]) -> None:
    assert refused_at(content) == "assets"


@pytest.mark.parametrize(
    ("content", "place"),
    [
        ({"variants": {**EVERY, "public": {"attack": "crop"}}}, "variants.public"),
        ({"variants": {**EVERY, "crop": {"attack": "gof"}}}, "variants.crop"),
        ({"variants": {**EVERY, "crop": {"decision": "mild"}}, "decisions": {"mild": {}}}, "variants.crop.decision"),
        ({"variants": {**EVERY, "crop": {"damage": 1, "fraction": 0.5}}}, "variants.crop.fraction"),
        ({"detectors": {"scene": {"command": "read"}}}, "detectors.scene"),
        ({"detectors": {"bits": {"command": "read"}}}, "detectors.bits"),
        ({"detectors": {"message_x": {"command": "read"}}}, "detectors.message_x"),
        ({"pairs": {"a": {"scene": "room", "message": "photos"}}}, "pairs.a"),
        ({"pairs": {"a": {"scene": "photos", "message": "room"}}}, "pairs.a"),
        ({"assets": {"bot": {"model": "bot.ply", "cameras": "orbit"}}}, "assets.bot.model"),
        ({"assets": {"desk": {"train": "desk"}}}, "assets.desk.train"),
    ],
    ids=str,
)
def test_what_no_job_could_use_is_refused_at_its_place(content: dict[str, Any], place: str) -> None:
    assert refused_at({**PAIR, **content}) == place


def test_a_missing_scene_of_a_publisher_is_refused_with_the_command_that_downloads_it() -> None:
    with pytest.raises(InputError) as refusal:
        planned(pair={"scene": "data/bicycle", "message": "photos"})
    assert refusal.value.field == "pairs.mine.scene"
    assert refusal.value.hint == "gspure download bicycle"


def test_a_command_that_is_no_command_is_refused_at_its_place() -> None:
    with pytest.raises(InputError) as refusal:
        planned(detectors={"mark": {"command": "read 'image"}})
    assert refusal.value.source == "mine.yaml: detectors.mark"


def test_only_an_asset_without_a_clean_model_is_the_clean_model_of_another() -> None:
    entry = {"model": written_model("a.ply"), "cameras": "orbit"}
    assets = {"a": {**entry, "clean": "b"}, "b": {**entry, "clean": "c"}, "c": entry}
    assert refused_at({"assets": assets}) == "assets.a.clean"
    assert refused_at({"assets": {"a": {**entry, "clean": "a"}}}) == "assets.a.clean"


def test_a_detector_gets_its_settings() -> None:
    detectors = {"mark": {"command": "read --fast", "message": "01", "timeout": 3}}
    model = only_model(planned(detectors=detectors))
    assert model.by_variant["gspure"].detectors == {"mark": Detector("read --fast", "01", 3.0)}


def test_of_controls_only_the_clean_model_is_read_by_detectors() -> None:
    variants = {**EVERY, "crop": {"damage": 1}}
    model = only_model(planned(detectors={"mark": {"command": "read"}}, variants=variants))
    read = {job.variant for job in model.controls if job.detectors}
    assert {CLEAN, CLEAN_GSPURE, WRONG_KEY, BLACK} <= {job.variant for job in model.controls}
    assert read == {CLEAN}


def test_detectors_do_not_read_the_clean_asset_of_a_marked_one_but_a_pair_of_its_name() -> None:
    Path("key").mkdir()
    clean = {"model": written_model("a.ply"), "cameras": "orbit"}
    assets = {"marked": {**clean, "key": "key", "scheme": "planted", "clean": "room"}, "room": clean}
    detectors = {"mark": {"command": "read"}}
    plan = plan_of({"assets": assets, "detectors": detectors, "pairs": {"room": {}}, "schemes": {"planted": {}}})
    read = {model.id.name: bool(model.by_variant["gspure"].detectors) for model in plan.models}
    assert read == {"vanilla/room": False, "planted/marked": True, "planted/room": True}


def test_bits_are_read_from_all_models_but_a_clean_one_after_gspure() -> None:
    model = only_model(planned(schemes={"marked_clones": {}}, variants={**EVERY, "crop": {"damage": 1}}))
    read = {job.variant: job.reads_bits for job in model.jobs}
    assert read.pop(CLEAN_GSPURE) is False
    assert all(read.values())


def test_a_traced_pair_is_made_from_its_settings() -> None:
    plan = planned(pair={"scene": "room", "message": "object-3", "views": 9, "width": 64, "seed": 4})
    training = plan.pairs["mine"]
    assert training.sources == ("room", "object-3")
    expected = {"protocol": "shared", "placement": "raised", "views": 9, "width": 64, "height": 120, "seed": 4}
    assert training.options == expected
    assert (training.users_files, training.inputs, plan.messages) == ((), (), {})


@pytest.mark.parametrize(("width", "is_small"), [(256, True), (257, False)])
def test_a_traced_pair_of_few_pixels_has_small_images(width: int, is_small: bool) -> None:
    plan = planned(pair={"width": width, "height": 256})
    assert plan.pairs["mine"].has_small_images is only_model(plan).has_small_images is is_small


@pytest.mark.parametrize(("views", "decoys"), [(3, 3), (24, 3), (25, 4), (33, 5)])
def test_a_random_scene_has_as_many_views_as_are_held_out(views: int, decoys: int) -> None:
    owner = only_model(planned(pair={"views": views, "width": 64, "height": 48})).owner
    assert owner is not None
    assert owner.decoys[-1].parent == Path(f"results/decoys/64x48x{decoys}")


def test_a_pair_of_photographs_trains_a_model_of_its_message() -> None:
    pair = {"scene": capture("scene"), "message": capture("photos/message"), "iterations": 7, "width": 16}
    plan = planned(pair=pair)
    ((name, message),) = plan.messages.items()
    assert name.startswith("message-")
    assert message.sources == ("photos/message",)
    assert message.options == {"iterations": 7, "resolution": "320px", "seed": 0}
    assert len([file for file in message.users_files if file.match("photos/message/images/*.png")]) == 9
    training = plan.pairs["mine"]
    trained = Path("results/messages") / name
    assert training.sources == ("scene", str(trained))
    assert training.inputs == (trained,)
    assert training.options == {"protocol": "shared", "resolution": "320px", "seed": 0}
    assert {file.parts[0] for file in training.users_files} == {"scene"}
    assert not training.has_small_images


def test_pairs_share_a_message_unless_its_training_differs() -> None:
    message = capture("message")
    pairs = {name: {"scene": capture(name), "message": message} for name in ("a", "b", "c")}
    pairs["c"]["iterations"] = 7
    names = [*planned(pairs=pairs).messages]
    assert len(names) == 2
    models = planned(pairs=pairs).models
    decoys = [model.owner.decoys if model.owner else () for model in models]
    assert decoys == [(Path(f"results/pairs/{name}/scene"),) for name in pairs]


def test_a_pair_at_own_poses_reads_photographs_of_both() -> None:
    plan = planned(pair={"scene": capture("scene"), "message": capture("message"), "protocol": "own"})
    training = plan.pairs["mine"]
    assert (training.sources, training.inputs, plan.messages) == (("scene", "message"), (), {})
    assert {file.parts[0] for file in training.users_files} == {"scene", "message"}
    assert only_model(plan).condition == Condition("planted", "own", "both")


def test_a_trained_message_is_read_in_place() -> None:
    plan = planned(pair={"scene": capture("scene"), "message": written_model("message.ply")})
    training = plan.pairs["mine"]
    assert (training.sources, training.inputs, plan.messages) == (("scene", "message.ply"), (), {})
    assert Path("message.ply") in training.users_files


def test_a_repetition_has_its_number_in_the_seed_of_training_and_attacks() -> None:
    variants = {**EVERY, "crop": {"seed": 5}}
    first, second = planned(schemes={"planted": {"seed": 3}}, variants=variants, repetitions=2).models
    assert (first.id.name, second.id.name) == ("planted/raised", "planted/raised@1")
    assert [model.embedding.seed for model in (first, second) if model.embedding] == [3, 4]
    assert [spec(model, "crop").seed for model in (first, second)] == [5, 6]


def test_a_model_of_a_pair_is_compared_with_photographs() -> None:
    model = only_model(planned())
    job = model.by_variant["gspure"]
    assert job.views.photographed == (SCENE, MESSAGE)
    assert model.photographs == Path("results/pairs/raised")
    assert {model.folder / "cameras.json", Path("results/pairs/raised/scene"), model.public} <= {*job.inputs}
    assert job.views.unattacked not in job.inputs
    assert job.modules == ("planted", "gspure.attacks.pruning")
    assert (job.rendered, job.compared, job.reads_bits) == (model.targets, model.targets, False)


def test_without_factors_of_a_scheme_those_of_an_attack_are_the_papers() -> None:
    model = only_model(planned(variants={**EVERY, "plain_weight": {}, "weak": {"attack": "plain_weight", "tau": 9}}))
    assert spec(model, "plain_weight").settings == {"tau": 4.0}
    assert spec(model, "weak").settings == {"tau": 9}
    assert spec(model, "gspure").settings == {}


def test_measurements_are_the_files_of_their_steps() -> None:
    variants = {**EVERY, "gof": {}, "lowest_opacity": {}, "random_matched": {}}
    model = only_model(planned(variants=variants))
    files = {name: spec(model, name).measured for name in variants}
    assert files == {
        "unattacked": {},
        "gspure": {"prune_mask": model.folder / "prune_mask.npy"},
        "gof": {"surface": model.folder / "surface.npy"},
        "lowest_opacity": {"opacities": model.folder / "opacities.npy"},
        "random_matched": {"prune_mask": model.folder / "prune_mask.npy"},
    }


def test_generated_views_are_those_of_their_settings() -> None:
    generated = {"count": 5, "fov": 60}
    asset = {"model": written_model("a.ply"), "cameras": "shells", "generated": generated, "resolution": "64px"}
    source = only_model(plan_of({"assets": {"a": asset}})).cameras[SCENE]
    assert (source.source, source.resolution) == ("shells", "native")
    assert source.generated == {"count": 5, "width": 640, "height": 480, "fov_degrees": 60.0}
    up = {**asset, "generated": {"up": [0, 0, 1]}}
    assert only_model(plan_of({"assets": {"a": up}})).cameras[SCENE].generated["up"] == [0.0, 0.0, 1.0]


def test_the_files_of_a_training_run_are_read_with_its_model() -> None:
    file = Path("runs/bot/point_cloud/iteration_7/point_cloud.ply")
    written_model(str(file))
    for folder in ("runs", "runs/bot", "runs/bot/point_cloud"):
        Path(folder, "cfg_args").touch()
    model = only_model(plan_of({"assets": {"bot": {"model": "runs/bot", "cameras": "orbit"}}}))
    assert model.users_files == (file, Path("runs/bot/cfg_args"))
    assert {*model.users_files} <= {*model.by_variant["gspure"].users_files}


def test_the_images_of_an_unpacked_sog_model_are_read_with_its_index() -> None:
    for name in ("meta.json", "means.webp", "other.ply"):
        Path(name).touch()
    assert model_files("meta.json") == (Path("meta.json"), Path("means.webp"))
    assert model_files("other.ply") == (Path("other.ply"),)


def test_the_points_of_a_capture_are_those_beside_its_cameras() -> None:
    file = views_with_photographs("photos/views.json")
    for folder in (".", "photos"):
        Path(folder, "points3D.ply").touch()
    assert capture_files(file) == (Path(file), Path("photos/points3D.ply"), Path("photos/v.png"))


def views_with_photographs(file: str, *, are_there: bool = True) -> str:
    place = Path(file)
    image = place.with_name("v.png").absolute()
    if are_there:
        write_image(image, np.zeros((6, 8, 3)))
    write_cameras(place, [replace(tilted_camera(8, 6, name="v"), image=image)])
    return file


def test_views_of_a_users_model_are_files_that_its_jobs_read() -> None:
    asset = {"model": written_model("a.ply"), "cameras": views_with_photographs("views.json"), "resolution": "4px"}
    model = only_model(plan_of({"assets": {"a": asset}}))
    assert model.camera_files == (Path("views.json"),)
    assert (model.cameras[SCENE].source, model.cameras[SCENE].resolution) == ("views.json", "4px")
    assert model.by_variant["gspure"].views.photographed == ()  # only a marked model is compared with photographs


@pytest.mark.parametrize("are_there", [True, False])
def test_a_marked_model_is_compared_with_photographs_that_are_there(are_there: bool) -> None:
    Path("key").mkdir()
    cameras = views_with_photographs("views.json", are_there=are_there)
    asset = {"model": written_model("a.ply"), "cameras": cameras, "key": "key", "scheme": "planted"}
    model = only_model(plan_of({"assets": {"a": asset}}))
    job = model.by_variant["gspure"]
    assert job.views.photographed == ((SCENE,) if are_there else ())
    assert model.folder / "message_cameras.json" in job.inputs
    assert model.owner is not None
    assert (model.owner.hides, model.owner.reveals, model.owner.photographs) == ("picture", True, None)


def test_an_adaptive_owner_learns_from_photographs_only_where_the_scheme_does() -> None:
    schemes = {"splats_in_splats": {}, "gs_hider": {}}
    owners = {model.id.scheme: model.owner for model in planned(schemes=schemes).models}
    photographs = {name: owner.photographs for name, owner in owners.items() if owner}
    assert photographs == {"splats_in_splats": None, "gs_hider": Path("results/pairs/raised/message")}
    plain = planned(schemes=schemes, extractions=["message"]).models
    assert [model.owner.photographs for model in plain if model.owner] == [None, None]


def test_a_trained_clean_model_is_an_input() -> None:
    assets = {
        "marked": {"model": written_model("a.ply"), "cameras": "orbit", "clean": "desk"},
        "desk": {"train": capture("desk")},
    }
    marked = plan_of({"assets": assets}).by_name["vanilla/marked"]
    control = marked.by_variant[CLEAN]
    assert control.public == Path("results/vanilla/desk/public/point_cloud.ply")
    assert control.public in control.inputs
    assert (control.rendered, control.compared) == ((SCENE,), (SCENE,))


def test_a_sweep_whose_name_is_a_variant_of_another_is_called_a_sweep() -> None:
    variants = {
        **EVERY,
        "crop": {"seed": 1},
        "wide": {"attack": "crop", "fraction": 0.9},
        "narrow": {"attack": "crop", "fraction": 0.4},
    }
    plan = planned(variants=variants)
    assert plan.sweeps == {"crop sweep": ("narrow", "wide")}
    assert plan.attacks["crop"] == ("narrow", "wide")
    assert plan.attacks["crop seed 1"] == ("crop",)


def gspure_with(decisions: Mapping[str, Mapping[str, Any]]) -> Plan:
    variants = {
        "unattacked": {},
        **{name: {"attack": "gspure", "decision": name} for name in decisions},
        "gspure": {},
    }
    return planned(decisions=decisions, variants=variants)


def test_factors_are_listed_from_those_of_gspure_on() -> None:
    decisions = {"noise": {"tau_n": 2}, "clusters": {"tau_c": 2}, "leaf": {"selection": "leaf", "tau_n": 2}}
    factors = gspure_with(decisions).factors["planted"]
    assert [*factors.items()] == [("gspure", (4.0, 4.0)), ("clusters", (4.0, 2.0)), ("noise", (2.0, 4.0))]


def test_there_are_no_factors_where_both_change_together() -> None:
    assert gspure_with({"both": {"tau_n": 2, "tau_c": 2}}).factors == {}


def test_the_meaning_of_a_variant_has_no_marks_of_code() -> None:
    meanings = planned().meanings
    assert meanings["gspure"] == "Remove the rows that GSPure decided on."
    assert not any("`" in meaning or "(paper" in meaning for meaning in meanings.values())


def test_a_plan_is_read_back_from_its_file() -> None:
    plan = planned(schemes={"planted": {}, "splats_in_splats": {}})
    write_json(Path("results") / PLAN, plain(plan))
    copy = read_plan(Path("results"))
    assert copy == plan
    assert [*copy.schemes] == ["planted", "splats_in_splats"]
    assert [*copy.by_name] == ["planted/raised", "splats_in_splats/raised"]
    with pytest.raises(InputError, match=PLAN):
        read_plan(Path())


def test_defaults_of_a_plan_are_those_of_a_configuration() -> None:
    entry = DetectorConfig("read")
    assert Detector("read") == Detector(entry.command, entry.message, entry.timeout)
    plan = plan_of({"assets": {"desk": {"train": capture("desk")}}})
    assert not only_model(plan).has_small_images
    assert not plan.trained["desk"].has_small_images
    assert not Owner("planted", Path("key"), Path("cameras.json"), "picture").reveals
