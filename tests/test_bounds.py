"""Bounds: every number that a user may set, in any attack, scheme or configuration, has them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
import yaml

from gspure import settings as bounds
from gspure.attacks.registry import attacks
from gspure.errors import InputError
from gspure.schemes.registry import schemes
from gspure.settings import Range, defaults, parsed_settings, require_settings
from gspure.settings import bounds as bounds_of
from gspure.workflow.configuration import validated

SCHEMA_FILE = Path(__file__).parents[1] / "schemas" / "config.schema.yaml"
SCHEMA = yaml.safe_load(SCHEMA_FILE.read_text())

NO_NUMBERS = ("", " ", "0x10", "1_0", " 1", "1\n", "١", "½", "--", "1,5", "None")
VALUES = (-1, 0, math.nan, math.inf, 10**9, 10**30, 10**400, 1e30, True, None, "", " ", "1", "1e3", "١", [], {})


def outcome(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a function returns, or its refusal."""
    try:
        return function(*arguments)
    except InputError as error:
        return error


FUNCTIONS = {f"attack {a.name}": a.function for a in attacks().values()}
FUNCTIONS |= {f"scheme {s.name}": s.embed for s in schemes().values()}
SETTINGS = {
    f"{name} {setting}": (function, setting) for name, function in FUNCTIONS.items() for setting in defaults(function)
}


def looked_up(schema: dict) -> dict:
    """Return a part of the schema with what it refers to."""
    if "$ref" not in schema:
        return schema
    place = SCHEMA
    for step in schema["$ref"].split("/")[1:]:
        place = place[step]
    return schema | looked_up(place)


def subschemas(schema: object, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], dict]]:
    """Return every part of the schema that describes values, with what it refers to."""
    if isinstance(schema, dict):
        if {"type", "$ref"} & schema.keys():
            yield path, looked_up(schema)
        for name, part in schema.items():
            if name not in {"default", "const", "if", "then"}:
                yield from subschemas(part, (*path, name))
    elif isinstance(schema, list):
        for part in schema:
            yield from subschemas(part, path)


@pytest.mark.parametrize("name", SETTINGS)
def test_every_number_of_attacks_and_schemes_has_bounds_that_admit_its_default(name):
    function, setting = SETTINGS[name]
    default, limits = defaults(function)[setting], bounds_of(function)[setting]
    if isinstance(default, str):
        assert limits is None
    else:
        assert default in limits
        assert -1e9 < limits.least < limits.most < 1e9
        assert limits.kind is type(default)


@pytest.mark.parametrize("name", SETTINGS)
def test_settings_out_of_bounds_are_refused(name):
    function, setting = SETTINGS[name]
    limits = bounds_of(function)[setting]
    for value in VALUES:
        refusal = outcome(require_settings, "test", function, {setting: value})
        is_accepted = value in limits if limits else isinstance(value, str) and bool(value.strip())
        assert (refusal is None) == is_accepted
        assert is_accepted or refusal.field == setting
    for word in NO_NUMBERS if limits else ("", " "):
        with pytest.raises(InputError):
            parsed_settings("test", function, {setting: word})


def test_bounds_in_annotations_that_are_texts_are_read():
    def attack(*, share: bounds.Share = 0.5) -> None: ...  # this module's annotations are texts

    assert bounds_of(attack) == {"share": bounds.SHARE}


PARTS = {".".join(path): part for path, part in subschemas(SCHEMA) if path[:1] != ("$defs",)}


@pytest.mark.parametrize("path", PARTS)
def test_every_number_and_text_of_the_configuration_has_bounds(path):
    part = PARTS[path]
    kind = part.get("type", "string")  # names, choices
    kinds = {kind} if isinstance(kind, str) else {*kind}
    if kinds == {"number", "string"}:
        assert path.split(".")[1] in {"schemes", "variants"}  # settings of schemes and attacks
    elif {"number", "integer"} & kinds:
        assert {"minimum", "exclusiveMinimum"} & part.keys()
        assert "maximum" in part
    elif "string" in kinds:
        assert {"enum", "pattern", "maxLength"} & part.keys()


def test_the_configuration_has_the_bounds_of_the_commands():
    schema = {name: part for name, part in SCHEMA["$defs"].items() if {"maximum"} & part.keys()}
    for name, part in schema.items():
        if name not in {"generated_views", "repetitions", "seed"}:
            limits = getattr(bounds, name.upper())
            least = "exclusiveMinimum" if limits.above else "minimum"
            assert part == {least: limits.least, "maximum": limits.most}
    assert schema["seed"]["maximum"] + schema["repetitions"]["maximum"] <= bounds.SEED.most
    assert schema["generated_views"]["maximum"] <= bounds.VIEWS.most


@pytest.mark.parametrize("value", [-1, math.nan, 10**30, 1e30, True, "1"])
@pytest.mark.parametrize(
    ("place", "name"),
    [
        ({"views": {}}, "off_path"),
        ({"views": {}}, "parts"),
        ({"pairs": {"room": {}}}, "views"),
        ({"assets": {"bot": {"model": "a", "cameras": "orbit", "generated": {}}}}, "width"),
        ({}, "repetitions"),
    ],
)
def test_numbers_of_the_configuration_out_of_bounds_are_refused(place, name, value):
    config = deepcopy(place)
    innermost = config
    while nested := [part for part in innermost.values() if isinstance(part, dict)]:
        innermost = nested[0]
    innermost[name] = value
    with pytest.raises(InputError, match=rf"^mine.yaml: [\w.]*{name}: "):
        validated(config, SCHEMA_FILE, "mine.yaml")


@pytest.mark.parametrize("value", [1, 10, 5.5])
def test_a_range_includes_its_ends_and_only_whole_numbers_if_they_are(value):
    assert (value in Range(1, 10)) == isinstance(value, int)
    assert value in Range(1.0, 10.0)
    assert 1.0 not in Range(1.0, 10.0, above=True)
