"""Configurations: YAML as people write it, several files, overrides, defaults, and what is refused where."""

import re
from collections.abc import Callable
from copy import deepcopy
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import yaml

from gspure.errors import InputError
from gspure.files import Json
from gspure.method.features import PARTS
from gspure.method.settings import FEATURES, MethodSettings
from gspure.scenes.rooms import PLACEMENTS, PROTOCOLS
from gspure.schemes.pair import INITIALIZATIONS
from gspure.workflow import planning
from gspure.workflow.config import DEFAULT_VARIANTS
from gspure.workflow.config_reading import SUITES, load_yaml, read_config
from gspure.workflow.matrix import expanded
from gspure.workflow.schema import config_schema
from tests.workflow_cases import ROOT, SOURCE, configuration

SHIPPED = {file.stem: file for folder in ("config", "experiments") for file in sorted((ROOT / folder).glob("*.yaml"))}
EVERY: dict[str, Any] = {"unattacked": {}, "gspure": {}}
BOT = {"model": "bot.ply", "cameras": "orbit"}
MARK = {"command": "read"}
KEYS = ("no", "Yes", "on", "null", "~", "2024_05", "1", "0x10", "1.50", "1e3", "2024-05-01")

Write = Callable[..., list[Path]]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write_files(*contents: str) -> list[Path]:
        files = [tmp_path / f"{i}.yaml" for i in range(len(contents))]
        for file, content in zip(files, contents, strict=True):
            file.write_text(content, encoding="utf-8")
        return files

    return write_files


@pytest.mark.parametrize(
    ("text", "content"),
    [
        ("a: no\nb: 1.5\nc: 0110\nd: ~\ne: 'no'", {"a": False, "b": 1.5, "c": 72, "d": None, "e": "no"}),
        ("\n".join(f"{key}: {{inner: 1}}" for key in KEYS), {key: {"inner": 1} for key in KEYS}),
        ("# nothing\n", {}),
        ("\ufeffthreads: 2", {"threads": 2}),
        ("x: &x {a: 1, b: 2}\ny: {<<: *x, b: 3}", {"x": {"a": 1, "b": 2}, "y": {"a": 1, "b": 3}}),
        ("x: {<<: [{a: 1}, {a: 2, b: 2}]}", {"x": {"a": 1, "b": 2}}),
        ("x: {y: &y {<<: {a: 0, c: 0}, a: 1}}\nz: *y", {"x": {"y": {"a": 1, "c": 0}}, "z": {"a": 1, "c": 0}}),
    ],
)
def test_keys_are_texts_as_written_and_values_and_merges_those_of_yaml(
    write: Write, text: str, content: dict[str, Any]
) -> None:
    assert load_yaml(*write(text)) == content


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("- 1", "content"),
        ("a: [", "file"),
        ("a: !!python/object/apply:os.getcwd []", "file"),
        ("[1]: 2", "file"),
        ("\x00", "file"),
        ("a:\n  b: 1\n  c: 2\n  b: 3\n", "b in line 4"),
        ("no: 1\n'no': 2", "no in line 2"),
        ("a: [{b: 1,\n  b: 2}]", "b in line 2"),
        ("a: &x {b: 1}\n<<: *x\n<<: *x", "<< in line 3"),
        ("pairs: {room_1: {}, room: {matrix: {seed: [1]}}}", "pairs"),
    ],
)
def test_a_file_that_is_no_mapping_with_each_key_once_is_refused(write: Write, text: str, place: str) -> None:
    (file,) = write(text)
    with pytest.raises(InputError) as refusal:
        read_config([file], {}, SOURCE)
    assert (refusal.value.source, refusal.value.field) == (str(file), place)


CROP = "variants: {unattacked: {}, gspure: {}, crop: &c {fraction: 0.5, seed: 3}, b: *c, d: {<<: *c, seed: 1}}"
HALF = {"fraction": 0.5, "seed": 3}
CHANGED_CROP = {**EVERY, "crop": {"fraction": 0.7, "seed": 3}, "b": HALF, "d": {"fraction": 0.5, "seed": 1}}
SWEPT = "variants: {unattacked: {}, gspure: {}, crop: {matrix: {fraction: [0.5], seed: [3, 4]}}}"
CROPS = {f"crop_0_5_{seed}": {"attack": "crop", "fraction": 0.5, "seed": seed} for seed in (3, 4)}


@pytest.mark.parametrize(
    ("files", "overrides", "content"),
    [
        (["extractions: [message]", "extractions: [message, b]"], {}, {"extractions": ["message", "b"]}),
        ([CROP, "variants: {crop: {fraction: 0.7}, gof: {}}"], {}, {"variants": {**CHANGED_CROP, "gof": {}}}),
        ([CROP], {"variants": {"crop": {"fraction": 0.7}}}, {"variants": CHANGED_CROP}),
        (["views: {parts: 2}", ""], {"views": {"evaluate": "all"}}, {"views": {"parts": 2, "evaluate": "all"}}),
        (["threads: 1"], {"threads": None}, {}),
        (["detectors: {}"], {"detectors": {"mark": MARK}}, {"detectors": {"mark": MARK}}),
        ([SWEPT, "variants: {crop: {seed: 3}}"], {}, {"variants": {**EVERY, **CROPS, "crop": {"seed": 3}}}),
    ],
)
def test_files_are_overlaid_entry_by_entry(write: Write, files: list[str], overrides: Json, content: Json) -> None:
    given = deepcopy(overrides)
    merged = read_config(write(*files), overrides, SOURCE)
    assert repr(merged) == repr(configuration(content))
    assert overrides == given


def test_a_decision_inherits_from_the_method_or_has_the_defaults() -> None:
    decisions = {"mild": {"tau_n": 2}, "same": {}}
    config = configuration({"method": {"tau_n": 3, "energy": "ewa"}, "decisions": decisions})
    assert config.decisions["same"] == config.method == MethodSettings(tau_n=3.0, energy="ewa")
    assert config.decisions["mild"] == MethodSettings(tau_n=2.0, energy="ewa")
    assert configuration({"decisions": decisions}).decisions["mild"] == MethodSettings(tau_n=2.0)


@pytest.mark.parametrize(
    ("content", "place"),
    [
        ({"method": {"tau_n": 0}}, "method.tau_n"),
        ({"method": 3, "decisions": {"a": {}}}, "method"),
        ({"method": {"tau_n": 2}, "decisions": {"a": 3}}, "decisions.a"),
        ({"decisions": {"method": {}}}, "decisions.method"),
        ({"decisions": {"a": {"cluster_on": ["position"]}}}, "decisions.a.cluster_on"),
        ({"pairs": {"a/b": {}}}, "pairs.a/b"),
        ({"pairs": {"ab" * 50 + "c": {}}}, f"pairs.{'ab' * 50}c"),
        ({"pairs": {"a\n": {}}}, "pairs.a\\n"),
        ({"detectors": {"mark": {**MARK, "message": 72}}}, "detectors.mark.message"),
        ({"detectors": {"mark": {"command": ""}}}, "detectors.mark.command"),
        ({"variants": {"gspure": {}}}, "variants.unattacked"),
        ({"variants": {"unattacked": {}}}, "variants.gspure"),
        ({"variants": {**EVERY, "crop": {"damage": [1, -1]}}}, "variants.crop.damage[1]"),
        ({"extractions": ["message_adaptive"]}, "extractions"),
        ({"assets": {"bot": {"model": "bot.ply"}}}, "assets.bot.cameras"),
        ({"assets": {"bot": {"train": "x", "model": "y"}}}, "assets.bot.model"),
        ({"assets": {"bot": {**BOT, "scheme": "keyss"}}}, "assets.bot.scheme"),
        ({"assets": {"bot": {**BOT, "message": "photos"}}}, "assets.bot.message"),
        ({"assets": {"bot": {**BOT, "resolution": "1/0"}}}, "assets.bot.resolution"),
        ({"assets": {"bot": {**BOT, "generated": {"up": [0, 0, 0]}}}}, "assets.bot.generated.up"),
    ],
    ids=str,
)
def test_what_no_job_could_use_is_refused_with_its_place(content: dict[str, Any], place: str) -> None:
    with pytest.raises(InputError) as refusal:
        configuration(content)
    assert (refusal.value.source, refusal.value.field) == (SOURCE, place)


@pytest.mark.parametrize("name", ["ab3_-" * 19 + "abcde", "x" * 19])
def test_a_long_name_is_admitted(name: str) -> None:
    assert [*configuration({"pairs": {name: {}}}).pairs] == [name]


@pytest.mark.parametrize("file", SHIPPED.values(), ids=lambda file: file.stem)
def test_a_shipped_configuration_is_read(file: Path) -> None:
    entries = expanded(yaml.safe_load(file.read_text()), file)
    shipped = read_config([file], {}, SOURCE)
    assert entries.keys() == {name for name in entries if getattr(shipped, name)}
    of_suite = load_yaml(SUITES / f"{entries['suite']}.yaml") if "suite" in entries else {}
    assert {*shipped.variants} == {*{**of_suite, **entries}.get("variants", DEFAULT_VARIANTS)}


@pytest.mark.parametrize("file", sorted(SUITES.glob("*.yaml")), ids=lambda file: file.stem)
def test_a_suite_stands_in_place_of_variants(file: Path) -> None:
    pair = {"pairs": {"room": {}}, "schemes": {"splats_in_splats": {}}}
    config = configuration({**pair, "suite": file.stem})
    assert {*config.variants} == {*load_yaml(file)["variants"]}
    plan = planning.plan_of(config, SOURCE)
    assert (plan.suite, len(plan.models[0].variants) >= len(config.variants)) == (file.stem, True)
    with pytest.raises(InputError, match="variants: expected nothing beside suite"):
        configuration({**pair, "suite": file.stem, "variants": {"gspure": {}}})
    with pytest.raises(InputError, match="suite: expected one of everyday-1, small-1, standard-1, found 'large'"):
        configuration({"suite": "large"})


OVERLAID = [*product(("config", "mini", "six_pairs"), ("ablations", "severity", "sweep", "views")), ("mini", "paper")]


@pytest.mark.parametrize(("base", "overlay"), OVERLAID)
def test_a_shipped_overlay_adds_to_a_configuration(base: str, overlay: str) -> None:
    files = [SHIPPED[base], SHIPPED[overlay]]
    below, above = (expanded(load_yaml(file), file) for file in files)
    merged = read_config(files, {}, SOURCE)
    assert merged.pairs.keys() == below["pairs"].keys()
    assert merged.variants == configuration({"variants": {**below.get("variants", {}), **above["variants"]}}).variants
    assert len(planning.plan_of(merged, SOURCE).models[0].variants) >= len(merged.variants)


def test_choices_are_those_of_the_code() -> None:
    pair = config_schema()["properties"]["pairs"]["additionalProperties"]["properties"]
    assert tuple(pair["protocol"]["enum"]) == PROTOCOLS
    assert tuple(pair["initialization"]["enum"]) == INITIALIZATIONS
    assert {*pair["placement"]["enum"]} == {*PLACEMENTS}
    assert tuple(PARTS) == FEATURES


def test_every_rule_on_the_device_has_a_gpu_and_no_other_rule_has() -> None:
    """The jobs of these rules have as many threads as the device needs."""
    text = "\n".join(path.read_text() for path in sorted((ROOT / "rules").glob("*.smk")))
    on_device: dict[str, bool] = {}
    pattern = r"^(?:use )?rule (?:(\w+) as )?(\w+)(?: with)?:\n(.*?)(?=^\S|\Z)"
    for base, name, rule in re.findall(pattern, text, re.MULTILINE | re.DOTALL):
        threads = re.search(r"threads: (.*)", rule)
        on_device[name] = "get_threads" in threads[1] if threads else on_device.get(base, False)
    profile = yaml.safe_load((ROOT / "profiles" / "slurm" / "config.yaml").read_text())
    asked = {rule for rule, resources in profile["set-resources"].items() if resources.get("gpu")}
    assert asked == {name for name, asks in on_device.items() if asks and not name.startswith("base_")}
