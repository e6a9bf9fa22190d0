"""The configuration: its schema, its defaults, and what is refused before any job starts."""

import re
from itertools import product
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

from gspure.attacks import attacks
from gspure.errors import InputError
from gspure.method.features import PARTS
from gspure.method.settings import FEATURES
from gspure.scenes.rooms import PLACEMENTS, PROTOCOLS
from gspure.schemes.pair import INITIALIZATIONS
from gspure.workflow.schema import config_schema
from tests.training_cases import colmap_project, ring
from tests.workflow_cases import ROOT, configuration, plan_of

BOT = {"model": __file__, "cameras": "orbit"}
PLANTED = {"pairs": {"room": {}}, "schemes": {"planted": {}}}
EVERY = {"unattacked": {}, "gspure": {}}
BASES = ("config.yaml", "mini.yaml", "six_pairs.yaml")
OVERLAYS = ("ablations.yaml", "severity.yaml", "sweep.yaml", "views.yaml")


def test_the_schema_is_valid():
    Draft202012Validator.check_schema(config_schema())


def test_naming_a_model_and_its_cameras_is_enough():
    (model,) = plan_of({"assets": {"bot": BOT}}).models
    assert model.id.scene == "bot"
    assert {job.case.name for job in model.variants} <= attacks().keys()
    assert {job.views.split for job in model.variants} == {"test"}


def test_choices_are_those_of_the_code():
    pair = config_schema()["properties"]["pairs"]["additionalProperties"]["properties"]
    assert tuple(pair["protocol"]["enum"]) == PROTOCOLS
    assert tuple(pair["initialization"]["enum"]) == INITIALIZATIONS
    assert {*pair["placement"]["enum"]} == {*PLACEMENTS}
    assert tuple(PARTS) == FEATURES


@pytest.mark.parametrize(("base", "overlay"), [*product(BASES, OVERLAYS)])
def test_shipped_configurations_can_be_combined(base, overlay):
    config, changes = (yaml.safe_load((ROOT / "config" / name).read_text()) for name in (base, overlay))
    for name, value in changes.items():
        config[name] = {**config.get(name, {}), **value} if isinstance(value, dict) else value
    assert len(plan_of(config).models[0].variants) >= len(config["variants"])


@pytest.mark.parametrize(
    ("config", "place"),
    [
        ({"asets": {}}, "asets"),
        ({"assets": {"bot": {"model": "bot.ply"}}}, "assets.bot.cameras"),
        ({"assets": {"bot": {**BOT, "message": "m"}}}, "assets.bot.message"),
        ({"assets": {"bot": {**BOT, "generated": {"up": [0, 0, 0]}}}}, "assets.bot.generated.up"),
        ({"method": {"selection": "best"}}, "method.selection"),
        ({"method": {"tau_n": 0}}, "method.tau_n"),
        ({"decisions": {"blind": {"cluster_on": ["position"]}}}, "decisions.blind.cluster_on"),
        ({"extractions": ["message_oracle"]}, "extractions"),
        ({"variants": {"gspure": {}}}, "variants.unattacked"),
    ],
    ids=str,
)
def test_a_wrong_setting_is_refused_at_its_place(config, place):
    with pytest.raises(InputError, match=f"^mine.yaml: {re.escape(place)}: "):
        configuration(config)


def variants(**changed):
    return {**PLANTED, "variants": {**EVERY, **changed}, "decisions": {"gentle": {}}}


@pytest.mark.parametrize(
    ("config", "line"),
    [
        ({}, "assets: expected at least one model, or a pair and a scheme, found none"),
        ({**PLANTED, "pairs": {"a": {"scene": "no", "message": "no"}}}, "pairs.a.scene: .* file or folder, found no"),
        (
            {**PLANTED, "schemes": {"splats": {}}},
            "schemes.splats: expected one of .*splats_in_splats.*, found 'splats'",
        ),
        ({**PLANTED, "schemes": {"planted": {"bits": 3}}}, "schemes.planted.bits: expected one of .*unknown key"),
        ({**PLANTED, "extractions": ["message", "message_x"]}, "extractions: expected one of message.*'message_x'"),
        ({**PLANTED, "decisions": {"method": {}}}, "decisions.method: "),
        ({"assets": {"bot": {**BOT, "model": "no.ply"}}}, "assets.bot.model: expected .* found no.ply"),
        ({"assets": {"bot": {**BOT, "cameras": "no.json"}}}, "assets.bot.cameras: .* found no.json"),
        ({"assets": {"bot": {"train": ".", "model": __file__}}}, "assets.bot.model: expected nothing beside train"),
        (variants(clean={"attack": "crop"}), "variants.clean: expected a name of no control"),
        (variants(gspur={}), "variants.gspur: expected one of .*plain_weight.*, found 'gspur'"),
        (variants(crop={"fraction": 2}), "variants.crop.fraction: expected a number from 0 to 1"),
        (variants(gspure={"decision": "mild"}), "variants.gspure.decision: expected one of gentle, found 'mild'"),
        (variants(gspure={"damage": 1}), "variants.gspure.damage: expected an attack with a strength, found gspure"),
    ],
    ids=str,
)
def test_a_setting_that_no_job_could_use_is_refused_in_one_line(config, line):
    with pytest.raises(InputError, match="^mine.yaml: " + line) as refusal:
        plan_of(config)
    assert "\n" not in str(refusal.value)


def test_a_list_of_damages_is_a_variant_for_each():
    plan = plan_of(variants(gspure_scaled={"damage": [0.3, 2]}, noise={"attack": "gaussian_noise", "damage": 1}))
    jobs = plan.models[0].variants
    names = [job.variant for job in jobs]
    assert names == ["gspure", "gspure_scaled@0.3dB", "gspure_scaled@2dB", "noise@1dB", "unattacked"]
    assert (jobs[3].case.name, jobs[3].case.damage) == ("gaussian_noise", 1.0)


def test_the_output_folder_of_a_training_run_stands_for_its_newest_model(tmp_path):
    for iteration in (7, 30):
        file = tmp_path / f"point_cloud/iteration_{iteration}/point_cloud.ply"
        file.parent.mkdir(parents=True)
        file.touch()
    (model,) = plan_of({"assets": {"bot": {**BOT, "model": str(tmp_path)}}}).models
    assert model.public == file


def test_photographs_are_files_of_the_training_and_a_missing_one_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    colmap_project(Path("garden"), ring(9), [[0.1 * i, 0.0, 0.0] for i in range(9)])
    files = plan_of({"assets": {"garden": {"train": "garden"}}}).trained["garden"].users_files
    photographs = [file for file in files if file.suffix == ".png"]
    assert len(photographs) == 9
    assert all(image.is_file() and not image.is_absolute() for image in photographs)
    photographs[0].unlink()
    with pytest.raises(InputError, match=photographs[0].name):
        plan_of({"assets": {"garden": {"train": "garden"}}})


PROFILE = yaml.safe_load((ROOT / "profiles" / "slurm" / "config.yaml").read_text())


def rules_on_the_device():
    """The rules whose jobs have as many threads as the device needs."""
    text = "\n".join(path.read_text() for path in sorted((ROOT / "rules").glob("*.smk")))
    on_device = {}
    pattern = r"^(?:use )?rule (?:(\w+) as )?(\w+)(?: with)?:\n(.*?)(?=^\S|\Z)"
    for base, name, rule in re.findall(pattern, text, re.MULTILINE | re.DOTALL):
        threads = re.search(r"threads: (.*)", rule)
        on_device[name] = "get_threads" in threads[1] if threads else on_device.get(base, False)
    return {name for name, asks in on_device.items() if asks and not name.startswith("base_")}


def test_every_rule_on_the_device_has_a_gpu_and_no_other_rule_has():
    asked = {rule for rule, resources in PROFILE["set-resources"].items() if resources.get("gpu")}
    assert asked == rules_on_the_device()
