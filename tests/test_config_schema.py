"""The configuration: what it accepts, what it fills in, and how it refuses."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from jsonschema import Draft202012Validator
from snakemake.utils import update_config

from gspure import constants
from gspure.attacks import attacks
from gspure.cameras import write_cameras
from gspure.cli.options import SPLITS
from gspure.cli.parser import Parser
from gspure.cli.train import add_arguments
from gspure.errors import InputError
from gspure.method.clusters import SELECTIONS
from gspure.method.features import PARTS
from gspure.method.weights import REDUCTIONS
from gspure.model import write_model
from gspure.opencl.frame import ENERGIES
from gspure.scenes.placement import PLACEMENTS
from gspure.scenes.staging import NAMES, PROTOCOLS, scene_builder
from gspure.schemes.pair import INITIALIZATIONS
from gspure.schemes.registry import schemes
from gspure.workflow.configuration import require_distinct_names, resolved, validated
from tests.models import blobs, camera

ROOT = Path(__file__).parents[1]
SCHEMA_FILE = ROOT / "schemas" / "config.schema.yaml"
SCHEMA = yaml.safe_load(SCHEMA_FILE.read_text())
BOT = {"model": "bot.ply", "cameras": "orbit"}
PLANTED = {"pairs": {"room": {}}, "schemes": {"planted": {}}}
ASSET = {"assets": {"bot": BOT}}


def filled(config):
    return validated(config, SCHEMA_FILE, "mine.yaml")


def settings(schema, path=()):
    """Every named setting of the schema: (path, subschema)."""
    for name, subschema in schema.get("properties", {}).items():
        yield (*path, name), subschema
        yield from settings(subschema, (*path, name))
        if isinstance(subschema.get("additionalProperties"), dict):
            yield from settings(subschema["additionalProperties"], (*path, name, "*"))


def test_the_schema_is_valid():
    Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize(
    ("path", "subschema"), [pytest.param(*found, id=".".join(found[0])) for found in settings(SCHEMA)]
)
def test_every_setting_has_a_description_and_a_default_or_is_required(path, subschema):
    if subschema == {"$ref": f"#/properties/method/properties/{path[-1]}"}:
        return  # a setting of the method that a decision may differ in
    assert subschema["description"].endswith(".")
    given = {("assets", "*", name) for name in ("model", "cameras", "train")} | {("detectors", "*", "command")}
    assert "default" in subschema or path in given | {
        ("variants", "*", name) for name in ("attack", "damage", "decision")
    }


@pytest.mark.parametrize("file", sorted((ROOT / "config").glob("*.yaml")), ids=lambda path: path.name)
def test_every_shipped_configuration_is_valid(file):
    validated(yaml.safe_load(file.read_text()), SCHEMA_FILE, file)


@pytest.mark.parametrize("overlay", [None, "severity", "ablations", "sweep", "paper", "views"])
@pytest.mark.parametrize("base", ["config", "mini", "six_pairs", "objects", "captures", "mipnerf360"])
def test_the_variants_of_every_shipped_configuration_resolve_with_those_that_it_may_be_combined_with(base, overlay):
    def read(name):
        return yaml.safe_load((ROOT / "config" / f"{name}.yaml").read_text())

    config = read(base)
    config.pop("assets", None)
    config["pairs"], config["schemes"] = read("mini")["pairs"], {"splats_in_splats": {}}
    if overlay:
        update_config(config, read(overlay))
    resolved(validated(config, SCHEMA_FILE, "mine.yaml"), "mine.yaml")


def test_pairs_of_two_initializations_differ():
    config = yaml.safe_load((ROOT / "config" / "six_pairs.yaml").read_text())
    assert "rooms_own_scene" in resolved(validated(config, SCHEMA_FILE, "six_pairs"), "six_pairs")["pairs"]


@pytest.mark.parametrize("name", [1, True, None])
def test_names_that_yaml_does_not_read_as_text_are_refused(name):
    for config in ({"assets": {name: BOT}}, {**ASSET, "variants": {"gof": {"tolerance": 3.0, name: 1}}}):
        with pytest.raises(InputError, match="names as text"):
            filled(config)


def test_naming_a_model_and_its_cameras_is_enough():
    config = filled(ASSET)
    assert config["assets"]["bot"].items() >= BOT.items()
    assert config["pairs"] == {}
    assert {"unattacked", "gspure"} <= config["variants"].keys()


def test_defaults_of_the_method_are_the_constants_of_the_code():
    method = filled({})["method"]
    names = ("min_samples", "min_cluster_size", "max_cluster_share")
    assert {name: method[name] for name in names} == {name: getattr(constants, name.upper()) for name in names}


def test_defaults_of_training_are_those_of_its_command():
    parser = Parser()
    add_arguments(parser)
    defaults = vars(parser.parse_args(["data", "--out", "trained"]))
    training = filled({"assets": {"desk": {"train": "data"}}})["assets"]["desk"]["training"]
    assert training == {name: defaults[name] for name in training}


def test_a_decision_may_differ_from_the_method_in_every_setting():
    decision = SCHEMA["properties"]["decisions"]["additionalProperties"]["properties"]
    assert decision.keys() == {"cluster_on", *SCHEMA["properties"]["method"]["properties"]}
    assert decision["cluster_on"]["items"]["enum"] == decision["cluster_on"]["default"] == list(PARTS)


def test_choices_are_those_of_the_code():
    method = SCHEMA["properties"]["method"]["properties"]
    assert set(method["selection"]["enum"]) == set(SELECTIONS)
    assert set(method["reduction"]["enum"]) == set(REDUCTIONS)
    assert set(method["energy"]["enum"]) == set(ENERGIES)
    pair = SCHEMA["properties"]["pairs"]["additionalProperties"]["properties"]
    assert set(pair["placement"]["enum"]) == set(PLACEMENTS)
    assert all(scene_builder(pair[name]["default"]) for name in ("scene", "message"))
    assert set(pair["protocol"]["enum"]) == set(PROTOCOLS)
    assert set(pair["initialization"]["enum"]) == set(INITIALIZATIONS)
    assert set(SCHEMA["properties"]["views"]["properties"]["evaluate"]["enum"]) == set(SPLITS)


def test_the_guide_shows_every_setting_with_its_default():
    guide = (ROOT / "config" / "README.md").read_text()
    shown = yaml.safe_load(re.findall(r"```yaml\n(.*?)```", guide, flags=re.DOTALL)[2])
    files = {"model": shown["assets"]["bicycle"]["model"], "cameras": shown["assets"]["bicycle"]["cameras"]}
    decided = {name: {"tau_n": decision["tau_n"]} for name, decision in shown["decisions"].items()}
    named = {"decisions": decided, "pairs": {"room": {}}, "schemes": {"splats_in_splats": {}}}
    config = filled({"assets": {"bicycle": files}, **named})
    for kind, available in (("variants", attacks()), ("schemes", schemes())):
        for name, settings in config[kind].items():
            settings |= {key: value for key, value in available[name].settings.items() if key != "attributes"}
            del settings["seed"]
    assert shown == config


def test_default_variants_are_known_attacks():
    assert filled({})["variants"].keys() <= attacks().keys()


def test_a_default_is_not_shared_between_two_configurations():
    filled({})["method"]["min_samples"] = 9
    assert filled({})["method"]["min_samples"] == constants.MIN_SAMPLES


def test_the_given_configuration_is_not_changed():
    config = {"method": {}}
    filled(config)
    assert config == {"method": {}}


@pytest.mark.parametrize(
    ("config", "line"),
    [
        ({"asets": {}}, "asets: expected one of assets, .* found an unknown key .did you mean assets"),
        ({"method": {"tau": 4}}, "method.tau: expected one of .*tau_c.*unknown key"),
        ({"assets": {"bot": {"model": "bot.ply"}}}, "assets.bot.cameras: expected an entry, found nothing"),
        ({"assets": {"bot": {"cameras": "orbit"}}}, "assets.bot.model: expected an entry, found nothing"),
        (
            {"assets": {"bot": {"train": "data", "training": {"resolution": "half"}}}},
            "assets.bot.training.resolution: .* found 'half'",
        ),
        ({"assets": {"a/b": BOT}}, "assets: expected a folder name of at most 100 .* found 'a/b'"),
        (
            {"assets": {"bot": BOT}, "detectors": {"b": {"command": "c", "message": "012"}}},
            "detectors.b.message: expected the embedded bits, such as 0110, .* found '012'",
        ),
        ({"method": {"selection": "best"}}, "method.selection: expected one of eom_capped, eom, leaf, found 'best'"),
        ({"method": {"tau_n": 0}}, "method.tau_n: expected more than 0, found 0"),
        ({"assets": {"bot": {**BOT, "resolution": "half"}}}, "assets.bot.resolution: .* found 'half'"),
        ({"views": {"parts": 1.5}}, "views.parts: expected type integer, found 1.5"),
        ({"variants": {"gspure": {}}}, "variants.unattacked: expected an entry, found nothing"),
        ({"pairs": {"room": {"views": 2}}}, "pairs.room.views: expected at least 3, found 2"),
        ({"method": None}, "method: expected type object, found None"),
        ({"decisions": {"gentle": {"tau": 2}}}, "decisions.gentle.tau: expected one of cluster_on, .* unknown key"),
        ({"decisions": {"gentle": {"tau_n": 0}}}, "decisions.gentle.tau_n: expected more than 0, found 0"),
        (
            {"decisions": {"where": {"cluster_on": ["position"]}}},
            "decisions.where.cluster_on: expected .*opacity.*weight.*, found .'position'.",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_wrong_setting_is_refused_in_one_line_that_names_it(config, line):
    with pytest.raises(InputError, match="^mine.yaml: " + line) as refusal:
        filled(config)
    assert "\n" not in str(refusal.value)


EVERY = {"unattacked": {}, "gspure": {}}


@pytest.mark.parametrize(
    ("config", "line"),
    [
        ({"method": {"tau_n": np.inf}}, "method.tau_n: expected type number, null, found inf"),
        ({"method": {"tau_c": np.nan}}, "method.tau_c: expected type number, null, found nan"),
        ({"method": {"views": 8.0}}, "method.views: expected type integer, null, found 8.0"),
        ({"decisions": {"method": {}}}, "decisions.method: "),
        (
            {"detectors": {"mark": {"command": "ls", "timeout": 1e30}}},
            "detectors.mark.timeout: expected at most 1",
        ),
        ({"assets": {"bot": {**BOT, "cameras": "c.json", "generated": {"fov": 60}}}}, "assets.bot.generated: "),
        ({"assets": {"bot": {**BOT, "generated": {"fov": 180}}}}, "assets.bot.generated.fov: expected at most 179"),
        ({"assets": {"bot": {**BOT, "generated": {"up": [0, 0, 0]}}}}, "assets.bot.generated.up: expected "),
        *(({"variants": {**EVERY, name: {"attack": "crop"}}}, f"variants.{name}: ") for name in ("clean", "public")),
        ({"variants": {**EVERY, "unattacked": {"attack": "crop"}}}, "variants.unattacked.attack: expected unattacked"),
        ({"variants": {**EVERY, "gspure": {"attack": "crop"}}}, "variants.gspure.attack: expected gspure"),
        ({"variants": {**EVERY, "gof": {"attack": "crop"}}}, "variants.gof.attack: expected gof"),
        ({"variants": {**EVERY, "random_matched": {"attack": "random_pruning"}}}, "variants.random_matched.attack: "),
        ({"variants": {**EVERY, "crop": {"damage": [1, 1.0000001]}}}, "variants.crop.damage: .* found crop@1dB twice"),
        (
            {"variants": {**EVERY, "crop": {"fraction": 2}}},
            "variants.crop.fraction: expected a number from 0 to 1",
        ),
        (
            {"variants": {**EVERY, "less": {"attack": "plain_weight", "tau": 0}}},
            "variants.less.tau: .* above 0, .* found 0",
        ),
        ({"variants": {**EVERY, "gspure_scaled": {"tau_c": -1}}}, "variants.gspure_scaled.tau_c: "),
        (
            {"variants": {**EVERY, "finetune": {"iterations": 0}}},
            "variants.finetune.iterations: expected a whole number from 1",
        ),
        ({"variants": {**EVERY, "distil": {"iterations": 2.5}}}, "variants.distil.iterations: expected a whole number"),
        (
            {"variants": {**EVERY, "prune_repair": {"learn": "none"}}},
            "variants.prune_repair.learn: expected one of",
        ),
        (
            {"schemes": {"planted": {"message_weight": 0.5}}},
            "schemes.planted.message_weight: expected a whole number from 0 to 1, found 0.5",
        ),
        (
            {"schemes": {"planted": {"message_weight": 0}}},
            "schemes.planted.message_weight: expected more than 0",
        ),
        (
            {"schemes": {"gs_hider": {"message_weight": -1}}},
            "schemes.gs_hider.message_weight: expected a number from 0",
        ),
        (
            {"schemes": {"keyss": {"network_rate": 0}}},
            "schemes.keyss.network_rate: expected a number from 1e-09 to 1",
        ),
        ({"schemes": {"secure_gs": {"max_anchors": 1}}}, "schemes.secure_gs.max_anchors: expected .* 8 to .* found 1"),
        (
            {"schemes": {"splats_in_splats": {"shift": 40}}},
            "schemes.splats_in_splats.shift: expected a whole number from 9 to 20",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_setting_that_a_job_would_refuse_is_refused_before_any_job(config, line):
    with pytest.raises(InputError, match="^mine.yaml: " + line):
        resolved(filled({**PLANTED, **config}), "mine.yaml")


@pytest.mark.parametrize("place", ["method", "decisions.few"])
@pytest.mark.parametrize(
    ("config", "scene", "views"),
    [
        ({"pairs": {"wide": {}, "room": {"views": 9}}, "schemes": {"planted": {}}}, "pairs.room", 7),
        ({"assets": {"bot": {**BOT, "cameras": "orbit", "generated": {"count": 17}}}}, "assets.bot", 14),
        ({"assets": {"bot": {**BOT, "cameras": "cameras.json"}}, "pairs": {"room": {"views": 9}}}, "assets.bot", 10),
    ],
    ids=["pair", "generated", "file"],
)
def test_weights_of_more_views_than_a_model_has_are_refused_before_any_job(
    tmp_path, monkeypatch, place, config, scene, views
):
    monkeypatch.chdir(tmp_path)
    write_model("bot.ply", blobs(4))
    write_cameras(Path("cameras.json"), [camera(40, 30, name=str(i)) for i in range(12)])

    def settled(views):
        chosen = {"views": views}
        return filled({**config, **({"method": chosen} if place == "method" else {"decisions": {"few": chosen}})})

    resolved(settled(views), "mine.yaml")
    with pytest.raises(InputError, match=f"{place}.views: expected at most {views}, the training views of {scene}"):
        resolved(settled(views + 1), "mine.yaml")


def test_settings_at_the_ends_of_their_ranges_are_accepted():
    variants = {**EVERY, "finetune": {"iterations": 1}, "crop": {"fraction": 1}, "sh_truncation": {"degree": 0}}
    schemes_of = {"secure_gs": {"max_anchors": 8, "density": 1}, "splats_in_splats": {"shift": 9, "hardened": 0}}
    config = filled({**PLANTED, "variants": variants, "schemes": schemes_of})
    assert resolved(config, "mine.yaml")["variants"].keys() == variants.keys()


def test_a_detector_without_a_program_is_refused():
    with pytest.raises(InputError, match="command: expected a program"):
        resolved(filled({**PLANTED, "detectors": {"mark": {"command": " "}}}), "mine.yaml")


def test_a_variant_is_an_attack_of_the_same_name_unless_it_names_one():
    config = filled({**PLANTED, "variants": {"unattacked": {}, "gspure": {}, "half": {"attack": "random_pruning"}}})
    attacks_of = {name: variant["attack"] for name, variant in resolved(config, "mine.yaml")["variants"].items()}
    assert attacks_of == {"unattacked": "unattacked", "gspure": "gspure", "half": "random_pruning"}


@pytest.mark.parametrize(
    ("change", "refused"),
    [
        ({}, True),
        ({"model": "copy.ply", "cameras": "copy.json"}, True),
        ({"model": "copy.ply", "cameras": "./views.json"}, True),
        ({"clean": "other"}, True),
        ({"model": "other.ply"}, False),
        ({"cameras": "orbit"}, False),
        ({"resolution": "99px"}, False),
    ],
)
def test_an_asset_that_repeats_another_is_refused(tmp_path, monkeypatch, change, refused):
    """It would count as another scene."""
    monkeypatch.chdir(tmp_path)
    for name in ("model.ply", "copy.ply", "views.json", "copy.json", "other.ply"):
        Path(name).write_text("other" if "other" in name else Path(name).suffix)
    asset = {"model": "model.ply", "cameras": "views.json"}
    other = {"model": "other.ply", "cameras": "shells"}
    config = filled({"assets": {"a": asset, "b": {**asset, **change}, "other": other}})
    if refused:
        with pytest.raises(InputError, match=r"assets\.b: expected another model, found the model and the views of a"):
            resolved(config, "mine.yaml")
    else:
        resolved(config, "mine.yaml")


def test_the_output_folder_of_a_training_run_stands_for_its_newest_model(tmp_path):
    for iteration in (900, 7000):
        (tmp_path / "point_cloud" / f"iteration_{iteration}").mkdir(parents=True)
        (tmp_path / "point_cloud" / f"iteration_{iteration}" / "point_cloud.ply").touch()
    config = filled({"assets": {"bot": {"model": str(tmp_path), "cameras": "orbit"}}})
    model = resolved(config, "mine.yaml")["assets"]["bot"]["model"]
    assert model == str(tmp_path / "point_cloud" / "iteration_7000" / "point_cloud.ply")


@pytest.mark.parametrize(
    ("config", "line"),
    [
        ({}, "assets: expected at least one model, or a pair and a scheme, found none"),
        ({"pairs": {"room": {}}}, "assets: expected at least one model, or a pair and a scheme, found none"),
        (
            {"pairs": {"room": {"message": "no"}}, "schemes": {"splats_in_splats": {}}},
            f"pairs.room: expected both of {NAMES}, or both paths, found room and no",
        ),
        (
            {"pairs": {"a": {"seed": 1}, "b": {"seed": 2}}, "schemes": {"splats_in_splats": {}}},
            "pairs.b: expected another pair, found the settings of a",
        ),
        (
            {"pairs": {"a": {"iterations": 9}, "b": {"resolution": "99px"}}, "schemes": {"splats_in_splats": {}}},
            "pairs.b: expected another pair, found the settings of a",
        ),
        (
            {"pairs": {"a": {"scene": "interior-01"}}, "schemes": {"splats_in_splats": {}}},
            f"pairs.a: expected both of {NAMES}, or both paths, found interior-01 and vault",
        ),
        (
            {"pairs": {"room": {"scene": "no", "message": "no"}}, "schemes": {"splats_in_splats": {}}},
            "pairs.room.scene: expected an existing file or folder, found no",
        ),
        (
            {"pairs": {"room": {}}, "schemes": {"splats": {}}},
            "schemes.splats: expected one of .*splats_in_splats.*, found 'splats'",
        ),
        (
            {"pairs": {"room": {}}, "schemes": {"splats_in_splats": {"bits": 3}}},
            "schemes.splats_in_splats.bits: expected one of iterations, .*, found an unknown key",
        ),
        ({"assets": {"bot": {"model": "no.ply", "cameras": "orbit"}}}, "assets.bot.model: expected .* found no.ply"),
        ({"assets": {"bot": {"model": __file__, "cameras": "no.json"}}}, "assets.bot.cameras: .* found no.json"),
        ({"assets": {"bot": {"train": "no"}}}, "assets.bot.train: expected an existing file or folder, found no"),
        ({"assets": {"bot": {"train": ".", "model": __file__}}}, "assets.bot.model: expected nothing beside train"),
        ({"assets": {"bot": {"train": ".", "cameras": "orbit"}}}, "assets.bot.cameras: expected nothing beside train"),
        (
            {**PLANTED, "variants": {"unattacked": {}, "gspure": {}, "random_pruning": {"share": 1}}},
            "variants.random_pruning.share: expected one of fraction, found an unknown key",
        ),
        (
            {
                **PLANTED,
                "variants": {"unattacked": {}, "gspure": {}, "random_pruning": {"fraction": "x"}},
            },
            "variants.random_pruning.fraction: expected a number.* found 'x'",
        ),
        (
            {**PLANTED, "variants": {"unattacked": {"sigma": 1}, "gspure": {}}},
            "variants.unattacked.sigma: expected no settings, found an unknown key",
        ),
        (
            {**PLANTED, "variants": {"unattacked": {}, "gspure": {"decision": "gentle"}}},
            "variants.gspure.decision: expected one of no decisions, found 'gentle'",
        ),
        (
            {
                **PLANTED,
                "decisions": {"gentle": {}},
                "variants": {"unattacked": {}, "gspure": {}, "reorder": {"decision": "gentle"}},
            },
            "variants.reorder.decision: expected no entry, since reorder uses no decision, found 'gentle'",
        ),
        (
            {
                **PLANTED,
                "decisions": {"gentle": {}},
                "variants": {"unattacked": {}, "gspure": {}, "random_matched": {"decision": "gentle"}},
            },
            "variants.random_matched.decision: expected method, the decision of gspure, found gentle",
        ),
        (
            {**PLANTED, "variants": {"unattacked": {}, "gspure": {"damage": 1}}},
            "variants.gspure.damage: expected an attack with a strength, found gspure",
        ),
        (
            {**PLANTED, "variants": {"unattacked": {}, "gspure": {}, "gof": {"damage": [1, 2], "tolerance": 3}}},
            "variants.gof.tolerance: expected nothing beside damage, found 3",
        ),
        (
            {**PLANTED, "extractions": ["message", "message_orakle"]},
            "extractions: expected some of message.*, found 'message_orakle'",
        ),
        (
            {**PLANTED, "variants": {"unattacked": {}, "gspure": {}, "gspur": {}}},
            "variants.gspur: expected one of .*plain_weight.*, found 'gspur'",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_files_of_the_configuration_must_exist(config, line):
    with pytest.raises(InputError, match="^mine.yaml: " + line):
        resolved(filled(config), "mine.yaml")


@pytest.mark.parametrize("name", ["a", "A_b-1", "_", "a" * 19, "x" + "ab" * 19, "ab" * 20 + "c", "ab" * 10 + "c" * 15])
def test_any_other_name_is_accepted(name):
    assert name in filled({"assets": {name: BOT}})["assets"]


def test_the_length_of_a_name_is_tested_first():
    began = time.process_time()
    with pytest.raises(InputError):
        filled({"assets": {"ab" * 5000 + "c": BOT}})
    assert time.process_time() - began < 10  # minutes if repetitions are searched for first


@pytest.mark.parametrize("name", ["a\n", "../a", "a/b", ".a", "-a", "", "a" * 101, "x" + "ab" * 20, "\x1b[2J"])
@pytest.mark.parametrize("part", ["assets", "pairs", "variants"])
def test_a_name_that_is_not_a_folder_name_is_refused(part, name):
    with pytest.raises(InputError) as caught:
        filled({**ASSET, part: {name: {}}})
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("nested", [dict, list])
def test_a_configuration_nested_too_deep_is_refused(nested):
    value = 1
    for _ in range(3000):
        value = {"a": value} if nested is dict else [value]
    with pytest.raises(InputError, match=r"mine\.yaml: file: expected settings, found maximum recursion depth"):
        filled({"assets": value})


@pytest.mark.parametrize("field", ["model", "cameras"])
@pytest.mark.parametrize("path", ["a" * 4000, "a\0b", "\ud800"])
def test_a_path_that_cannot_exist_is_refused(tmp_path, field, path):
    (tmp_path / "bot.ply").touch()
    asset = {"model": str(tmp_path / "bot.ply"), "cameras": "orbit"} | {field: path}
    with pytest.raises(InputError, match=rf"mine\.yaml: assets\.bot\.{field}: expected an existing file or folder"):
        resolved(filled({"assets": {"bot": asset}}), "mine.yaml")


@pytest.mark.parametrize("field", ["model", "cameras", "train"])
def test_a_path_with_braces_is_refused_before_snakemake_takes_them_for_wildcards(tmp_path, field):
    (tmp_path / "{bot}.ply").touch()
    (tmp_path / "bot.ply").touch()
    asset = {} if field == "train" else {"model": str(tmp_path / "bot.ply"), "cameras": "orbit"}
    with pytest.raises(InputError, match=rf"mine\.yaml: assets\.bot\.{field}: expected a path without {{ }} < >"):
        resolved(filled({"assets": {"bot": asset | {field: str(tmp_path / "{bot}.ply")}}}), "mine.yaml")


def test_a_photograph_with_braces_in_its_name_is_refused(tmp_path):
    write_cameras(tmp_path / "cameras.json", [replace(camera(40, 30), image=Path("{1}.png"))])
    with pytest.raises(InputError, match=r"photographs: expected a path without \{ \} < >, found .*\{1\}\.png"):
        resolved(filled({"assets": {"bot": {"train": str(tmp_path / "cameras.json")}}}), "mine.yaml")


@pytest.mark.parametrize(
    "text",
    [
        "assets:\n  a: {cameras: orbit}\n  a: {cameras: shells}\n",
        "variants: {gspure: {}, crop: {}, gspure: {}}",
        "pairs: {}\nassets: {}\npairs: {}",
        "decisions:\n  - {share: 1, share: 2}\n",
    ],
)
def test_a_configuration_that_repeats_a_name_is_refused(tmp_path, text):
    (file := tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(InputError, match="each name once"):
        require_distinct_names(file)


@pytest.mark.parametrize("text", ["a: &x {b: 1}\nc: *x\nd: {<<: *x, b: 2}", "a: &x [*x]", "", "a: {b: 1}\nc: {b: 1}"])
def test_names_may_be_repeated_in_other_mappings_and_by_aliases(tmp_path, text):
    (file := tmp_path / "mine.yaml").write_text(text)
    require_distinct_names(file)


@pytest.mark.parametrize("value", ["9" * 5000, "{{1}}", "[]: 1"], ids=["digits", "mapping", "list"])
def test_values_that_no_configuration_can_have_are_refused_in_one_line(tmp_path: Path, value: str) -> None:
    (tmp_path / "c.yaml").write_text(f"assets: {{a: {{views: {value}}}}}")
    with pytest.raises(InputError, match=r"c\.yaml: file: expected a configuration"):
        require_distinct_names(tmp_path / "c.yaml")
