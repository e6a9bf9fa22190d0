"""Reading configurations: YAML as people write it, several files, overrides, and what is refused where."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from gspure.errors import InputError, MissingFileError
from gspure.method.settings import MethodSettings
from gspure.workflow.config import DEFAULT_VARIANTS, Config, VariantConfig
from gspure.workflow.config_reading import load_yaml, read_config
from tests.workflow_cases import ROOT, configuration

SHIPPED = sorted((ROOT / "config").glob("*.yaml"))
SOURCE = "mine.yaml, severity.yaml"
EVERY = {"unattacked": {}, "gspure": {}}
BOT = {"model": "bot.ply", "cameras": "orbit"}

Write = Callable[..., list[Path]]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write_files(*contents: str) -> list[Path]:
        files = [tmp_path / f"{i}.yaml" for i in range(len(contents))]
        for file, content in zip(files, contents, strict=True):
            file.write_text(content, encoding="utf-8")
        return files

    return write_files


def config(files: list[Path], overrides: Mapping[str, Any] | None = None) -> Config:
    return read_config(files, overrides or {}, SOURCE)


@pytest.mark.parametrize("key", ["no", "Yes", "on", "null", "~", "2024_05", "1", "0x10", "1.50", "1e3", "2024-05-01"])
def test_a_key_is_the_text_that_is_written(write: Write, key: str) -> None:
    assert load_yaml(*write(f"{key}: {{inner: 1}}")) == {key: {"inner": 1}}


def test_names_that_yaml_takes_for_numbers_are_names(write: Write) -> None:
    text = "assets: {no: {model: a.ply, cameras: orbit}, 2024_05: {model: b.ply, cameras: orbit}}"
    assert [*config(write(text)).assets] == ["no", "2024_05"]


def test_values_are_those_of_yaml(write: Write) -> None:
    content = load_yaml(*write("a: no\nb: 1.5\nc: 0110\nd: ~\ne: 'no'"))
    assert content == {"a": False, "b": 1.5, "c": 72, "d": None, "e": "no"}


@pytest.mark.parametrize("text", ["", "# nothing\n", "---\n"])
def test_a_file_without_entries_changes_nothing(write: Write, text: str) -> None:
    assert load_yaml(*write(text)) == {}
    assert config(write(text)) == configuration({})


def test_a_byte_order_mark_is_no_part_of_a_key(write: Write) -> None:
    assert load_yaml(*write("\ufeffthreads: 2")) == {"threads": 2}


@pytest.mark.parametrize("text", ["- 1", "3", "text"])
def test_a_file_that_is_no_mapping_is_refused(write: Write, text: str) -> None:
    (file,) = write(text)
    with pytest.raises(InputError) as refusal:
        load_yaml(file)
    assert (refusal.value.source, refusal.value.field) == (str(file), "content")


@pytest.mark.parametrize(
    "text", ["a: [", "a: 1\n b: 2", "a: *b", "a: !!python/object/apply:os.getcwd []", "[1]: 2", "? {a: 1}\n: 2", "\x00"]
)
def test_a_file_that_is_no_plain_yaml_is_refused(write: Write, text: str) -> None:
    (file,) = write(text)
    with pytest.raises(InputError) as refusal:
        load_yaml(file)
    assert (refusal.value.source, refusal.value.field) == (str(file), "file")


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError):
        load_yaml(tmp_path / "no.yaml")


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("a: 1\nb: 2\na: 3", "a in line 3"),
        ("a:\n  b: 1\n  c: 2\n  b: 3\n", "b in line 4"),
        ("no: 1\n'no': 2", "no in line 2"),
        ("1: 1\n1: 2", "1 in line 2"),
        ("a: [{b: 1,\n  b: 2}]", "b in line 2"),
        ("a: &x {b: 1}\n<<: *x\n<<: *x", "<< in line 3"),
    ],
)
def test_a_key_twice_is_refused_with_its_line(write: Write, text: str, place: str) -> None:
    (file,) = write(text)
    with pytest.raises(InputError) as refusal:
        load_yaml(file)
    assert (refusal.value.source, refusal.value.field) == (str(file), place)


def test_merged_entries_may_be_overridden(write: Write) -> None:
    text = "base: &base {a: 1, b: 2}\nfirst: {<<: *base, b: 3}\nlast: {b: 4, <<: *base}"
    content = load_yaml(*write(text))
    assert content == {"base": {"a": 1, "b": 2}, "first": {"a": 1, "b": 3}, "last": {"a": 1, "b": 4}}


def test_of_several_merged_mappings_the_first_counts(write: Write) -> None:
    text = "x: &x {a: 1}\ny: &y {a: 2, b: 2}\nz: {<<: [*x, *y]}"
    assert load_yaml(*write(text))["z"] == {"a": 1, "b": 2}


def test_a_merged_mapping_may_have_merged_others(write: Write) -> None:
    text = "x: &x {a: 0, c: 0}\ndeep: {y: &y {<<: *x, a: 1}}\nz: {<<: *y, b: 2}"
    content = load_yaml(*write(text))
    assert content["z"] == {"a": 1, "b": 2, "c": 0}
    assert content["deep"] == {"y": {"a": 1, "c": 0}}


def test_later_files_lay_over_earlier_ones_entry_by_entry(write: Write) -> None:
    base = "threads: 1\nvariants: {unattacked: {}, gspure: {}, crop: {fraction: 0.5, seed: 3}}\nextractions: [message]"
    overlay = "variants: {crop: {fraction: 0.7}, gof: {}}\nextractions: [message, message_adaptive]"
    merged = config(write(base, overlay))
    assert [*merged.variants] == ["unattacked", "gspure", "crop", "gof"]
    assert merged.variants["crop"] == VariantConfig(settings={"fraction": 0.7}, seed=3)
    assert (merged.threads, merged.extractions) == (1, ("message", "message_adaptive"))


def test_overrides_are_laid_over_all_files(write: Write) -> None:
    files = write("threads: 1\nviews: {parts: 2}", "threads: 2")
    merged = config(files, {"threads": 3, "views": {"evaluate": "all"}})
    assert (merged.threads, merged.views.parts, merged.views.evaluate) == (3, 2, "all")


def test_an_override_replaces_what_is_no_mapping_and_null_restores_a_default(write: Write) -> None:
    merged = config(write("threads: 1\ndetectors: {}"), {"threads": None, "detectors": {"mark": {"command": "read"}}})
    assert merged.threads is None
    assert merged.detectors["mark"].command == "read"


def test_an_overlay_of_one_alias_leaves_the_others(write: Write) -> None:
    entries = "crop: &c {attack: crop, fraction: 0.5}, alias: *c, merged: {<<: *c, seed: 1}"
    base = f"variants: {{unattacked: {{}}, gspure: {{}}, {entries}}}"
    merged = config(write(base, "variants: {crop: {fraction: 0.7}}"))
    fractions = {name: variant.settings.get("fraction") for name, variant in merged.variants.items()}
    assert fractions == {"unattacked": None, "gspure": None, "crop": 0.7, "alias": 0.5, "merged": 0.5}


def test_overrides_are_left_as_they_are(write: Write) -> None:
    overrides: dict[str, Any] = {"views": {"parts": 2}}
    config(write("views: {evaluate: all}"), overrides)
    assert overrides == {"views": {"parts": 2}}


def test_without_entries_all_defaults_hold() -> None:
    config = configuration({})
    assert (config.assets, config.pairs, config.schemes) == ({}, {}, {})
    assert (config.repetitions, config.views.evaluate, config.views.parts) == (1, "test", 1)
    assert config.method == MethodSettings()
    assert config.variants == {name: VariantConfig() for name in DEFAULT_VARIANTS}


def test_settings_of_attacks_and_schemes_are_kept_beside_the_entries_of_all() -> None:
    variants = {**EVERY, "crop": {"attack": "crop", "fraction": 1, "seed": 2}}
    config = configuration({"variants": variants, "schemes": {"planted": {"gaussians": 600, "seed": 4}}})
    assert config.variants["crop"] == VariantConfig(settings={"fraction": 1}, attack="crop", seed=2)
    assert (config.schemes["planted"].settings, config.schemes["planted"].seed) == ({"gaussians": 600}, 4)


@pytest.mark.parametrize(("damage", "expected"), [(1, 1.0), ([0.5, 2], (0.5, 2.0)), (None, None)])
def test_a_damage_is_a_number_or_a_list(damage: object, expected: object) -> None:
    config = configuration({"variants": {**EVERY, "crop": {"damage": damage}}})
    assert config.variants["crop"].damage == expected


def test_a_decision_inherits_from_the_method() -> None:
    config = configuration({"method": {"tau_n": 3, "energy": "ewa"}, "decisions": {"mild": {"tau_n": 2}, "same": {}}})
    assert config.decisions["same"] == config.method == MethodSettings(tau_n=3.0, energy="ewa")
    assert config.decisions["mild"] == MethodSettings(tau_n=2.0, energy="ewa")


def test_without_a_method_a_decision_has_the_defaults() -> None:
    assert configuration({"decisions": {"mild": {"tau_n": 2}}}).decisions == {"mild": MethodSettings(tau_n=2.0)}


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "unknown key": ({"asets": {}}, "asets"),
    "unknown key below": ({"method": {"tau_m": 2}}, "method.tau_m"),
    "name with a blank": ({"assets": {"my bot": BOT}}, "assets.my bot"),
    "name with a slash": ({"pairs": {"a/b": {}}}, "pairs.a/b"),
    "name like an option": ({"pairs": {"-a": {}}}, "pairs.-a"),
    "empty name": ({"pairs": {"": {}}}, "pairs."),
    "long name": ({"pairs": {"ab" * 50 + "c": {}}}, f"pairs.{'ab' * 50}c"),
    "name that repeats itself": ({"pairs": {"x" * 20: {}}}, f"pairs.{'x' * 20}"),
    "name that ends with a line": ({"pairs": {"a\n": {}}}, "pairs.a\\n"),
    "bits without quotes": ({"detectors": {"mark": {"command": "read", "message": 72}}}, "detectors.mark.message"),
    "other digits than bits": (
        {"detectors": {"mark": {"command": "read", "message": "012"}}},
        "detectors.mark.message",
    ),
    "empty command": ({"detectors": {"mark": {"command": ""}}}, "detectors.mark.command"),
    "missing entry": ({"detectors": {"mark": {}}}, "detectors.mark.command"),
    "choice": ({"views": {"evaluate": "some"}}, "views.evaluate"),
    "resolution": ({"assets": {"bot": {**BOT, "resolution": "1600"}}}, "assets.bot.resolution"),
    "resolution of none": ({"assets": {"bot": {**BOT, "resolution": "1/0"}}}, "assets.bot.resolution"),
    "number in quotes": ({"threads": "2"}, "threads"),
    "two directions": ({"assets": {"bot": {**BOT, "generated": {"up": [0, 1]}}}}, "assets.bot.generated.up"),
    "no direction": ({"assets": {"bot": {**BOT, "generated": {"up": [0, 0, 0]}}}}, "assets.bot.generated.up"),
    "setting that is a list": ({"variants": {**EVERY, "crop": {"fraction": [1]}}}, "variants.crop.fraction"),
    "negative damage": ({"variants": {**EVERY, "crop": {"damage": [1, -1]}}}, "variants.crop.damage[1]"),
    "no damage": ({"variants": {**EVERY, "crop": {"damage": 0}}}, "variants.crop.damage"),
    "no mapping": ({"pairs": ["room"]}, "pairs"),
    "empty entry": ({"pairs": {"room": None}}, "pairs.room"),
    "no decisions": ({"decisions": None}, "decisions"),
    "decision that is no mapping": ({"method": {"tau_n": 2}, "decisions": {"a": 3}}, "decisions.a"),
    "list of decisions": ({"method": {"tau_n": 2}, "decisions": ["a"]}, "decisions"),
    "method that is no mapping": ({"method": 3, "decisions": {"a": {}}}, "method"),
    "decision of the method's name": ({"decisions": {"method": {}}}, "decisions.method"),
    "decision on places": ({"decisions": {"a": {"cluster_on": ["position"]}}}, "decisions.a.cluster_on"),
    "no unattacked variant": ({"variants": {"gspure": {}}}, "variants.unattacked"),
    "no gspure": ({"variants": {"unattacked": {}}}, "variants.gspure"),
    "no plain extraction": ({"extractions": ["message_adaptive"]}, "extractions"),
    "no extraction": ({"extractions": []}, "extractions"),
    "asset without cameras": ({"assets": {"bot": {"model": "bot.ply"}}}, "assets.bot.cameras"),
    "asset without a model": ({"assets": {"bot": {"cameras": "orbit"}}}, "assets.bot.model"),
    "model beside photographs": ({"assets": {"bot": {"train": "x", "model": "y"}}}, "assets.bot.model"),
    "key beside photographs": ({"assets": {"bot": {"train": "x", "key": "y"}}}, "assets.bot.key"),
    "scheme without a key": ({"assets": {"bot": {**BOT, "scheme": "keyss"}}}, "assets.bot.scheme"),
    "message without a key": ({"assets": {"bot": {**BOT, "message": "photos"}}}, "assets.bot.message"),
}


@pytest.mark.parametrize(("content", "place"), REFUSED.values(), ids=REFUSED)
def test_what_no_job_could_use_is_refused_with_its_place(content: dict[str, Any], place: str) -> None:
    with pytest.raises(InputError) as refusal:
        configuration(content)
    assert (refusal.value.source, refusal.value.field) == ("mine.yaml", place)


def test_a_refusal_names_all_files(write: Write) -> None:
    with pytest.raises(InputError) as refusal:
        config(write("threads: 0"))
    assert refusal.value.source == SOURCE


def test_a_misspelt_key_is_refused_with_a_suggestion() -> None:
    with pytest.raises(InputError) as refusal:
        configuration({"method": {"min_sample": 3}})
    assert refusal.value.expected == "min_samples?"


ADMITTED = {
    "longest name": {"pairs": {"ab3_-" * 19 + "abcde": {}}},
    "name that repeats a little": {"pairs": {"x" * 19: {}}},
    "photographs": {"assets": {"desk": {"train": "data/desk"}}},
    "marked model": {"assets": {"bot": {**BOT, "key": "key", "scheme": "keyss", "message": "photos"}}},
    "direction": {"assets": {"bot": {**BOT, "generated": {"up": [0, 0, 1]}}}},
    "decision on weights": {"decisions": {"a": {"cluster_on": ["weight"]}}},
    "decision on opacities": {"decisions": {"a": {"cluster_on": ["opacity", "position"]}}},
    "extractions": {"extractions": ["message_adaptive", "message"]},
    "bits in quotes": {"detectors": {"mark": {"command": "read", "message": "0110"}}},
    "resolutions": {"pairs": {name: {"resolution": name} for name in ("native", "photographs")}},
    "fraction of the resolution": {"pairs": {"a": {"resolution": "1/8"}}},
    "path with a line": {"pairs": {"a": {"scene": "a\nb"}}},
}


@pytest.mark.parametrize("content", ADMITTED.values(), ids=ADMITTED)
def test_what_a_job_can_use_is_admitted(content: dict[str, Any]) -> None:
    configuration(content)


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_a_shipped_configuration_is_read(file: Path) -> None:
    entries = yaml.safe_load(file.read_text())
    shipped = config([file])
    assert entries.keys() == {name for name in entries if getattr(shipped, name)}
    assert {*shipped.variants} == {*entries.get("variants", DEFAULT_VARIANTS)}


@pytest.mark.parametrize("overlay", ["ablations", "severity", "sweep", "views", "paper"])
def test_a_shipped_overlay_adds_to_a_configuration(overlay: str) -> None:
    base = ROOT / "config" / "mini.yaml"
    file = ROOT / "config" / f"{overlay}.yaml"
    merged = config([base, file])
    assert merged.pairs == config([base]).pairs
    assert merged.variants == {**config([base]).variants, **config([file]).variants}
