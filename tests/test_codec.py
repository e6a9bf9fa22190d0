"""The codec of configurations, plans and results: round trips, exact numbers, refusals with their place, schemas."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, is_dataclass, replace
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from gspure import codec
from gspure.codec import KIND, REST, Text, parsed, plain, read, schema
from gspure.errors import InputError
from gspure.evaluation.identity import ModelId
from gspure.evaluation.plan import AttackSpec, Control, Job, Owner, Plan, Views
from gspure.method.settings import MethodSettings
from gspure.settings import Range, Setting
from gspure.workflow.config import Config
from gspure.workflow.schema import schema_text
from tests.workflow_cases import ROOT, plan_of

SOURCE = "drawing.yaml"


class Point(NamedTuple):
    x: float
    y: float = 0.5


@dataclass(frozen=True)
class Circle:
    centre: Point
    radius: Annotated[float, Range(0.0, 9.0, above=True), "Radius in metres."] = 1.0


@dataclass(frozen=True)
class Polygon:
    corners: tuple[Point, ...] = ()
    is_closed: bool = True


@dataclass(frozen=True)
class Drawing:
    """One field of every kind."""

    shape: Circle | Polygon
    name: Annotated[str, Text("[a-z]+", "small letters")] = "sun"
    kind_of_paper: Literal["plain", "ruled", 7] = "plain"
    size: tuple[int, int] = (3, 4)
    files: Mapping[str, Path] = field(default_factory=dict)
    limit: float | None = None
    levels: float | tuple[float, ...] = 0.0
    mean: float = 0.0
    backdrop: Circle | Polygon | None = None
    settings: Annotated[Mapping[str, Setting], REST] = field(default_factory=dict)


@dataclass(frozen=True)
class Brush:
    settings: Annotated[Mapping[str, Setting], REST]
    width: float = 1.0


SUN = Drawing(Circle(Point(1.0, 2.0)))
DRAWINGS = {
    "defaults": SUN,
    "another class": replace(SUN, shape=Polygon((Point(0.0), Point(1e-300, -0.0)), is_closed=False)),
    "text": replace(SUN, name="moon", kind_of_paper="ruled"),
    "literal number": replace(SUN, kind_of_paper=7),
    "paths": replace(SUN, files={"a": Path("b/c d.png"), "é": Path("/é")}),
    "number or none": replace(SUN, limit=0.1),
    "number or list": replace(SUN, levels=(0.25, 3.0)),
    "class or none": replace(SUN, backdrop=Polygon()),
    "rest": replace(SUN, settings={"bits": 3, "tau": 3.0, "codec": "3"}),
}


@pytest.mark.parametrize("drawing", DRAWINGS.values(), ids=DRAWINGS)
def test_a_value_survives_a_round_trip(drawing: Drawing) -> None:
    assert parsed(Drawing, codec.text(drawing)) == drawing


def test_text_is_one_line_of_json_with_letters_of_all_languages() -> None:
    line = codec.text(replace(SUN, settings={"codec": "é\n"}))
    assert "\n" not in line
    assert "é" in line
    assert json.loads(line)["codec"] == "é\n"


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_is_null_and_comes_back_as_nan(number: float) -> None:
    content = plain(replace(SUN, mean=number))
    assert content["mean"] is None
    assert math.isnan(read(Drawing, content, SOURCE).mean)


def test_rest_takes_the_keys_of_no_field() -> None:
    content = plain(replace(SUN, settings={"bits": 3}))
    assert content["bits"] == 3
    assert "settings" not in content
    assert read(Drawing, {"shape": content["shape"], "settings": 4}, SOURCE).settings == {"settings": 4}


def test_a_class_of_a_union_is_named_only_where_there_is_a_choice() -> None:
    assert plain(SUN)["shape"] == {KIND: "Circle", "centre": {"x": 1.0, "y": 2.0}, "radius": 1.0}
    assert KIND not in plain(SUN.shape)


def test_reading_leaves_its_content_as_it_is() -> None:
    content = plain(SUN)
    read(Drawing, content, SOURCE)
    assert content == plain(SUN)


def test_entries_with_a_default_may_be_left_out() -> None:
    assert read(Drawing, {"shape": {KIND: "Circle", "centre": {"x": 1, "y": 2}}}, SOURCE) == SUN
    assert read(Point, {"x": 1}, SOURCE) == Point(1.0)


def test_defaults_are_not_shared_between_values() -> None:
    first, second = (read(Drawing, {"shape": {KIND: "Polygon"}}, SOURCE) for _ in range(2))
    assert first.settings is not second.settings


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        (float, 3, 3.0),
        (float | None, 3, 3.0),
        (int, 3, 3),
        (Setting, 3, 3),
        (Setting, 3.0, 3.0),
        (Setting, "3", "3"),
        (float | tuple[float, ...], 3, 3.0),
        (float | tuple[float, ...], [3], (3.0,)),
        (tuple[float, ...], (3, 4), (3.0, 4.0)),
        (Annotated[float, Range(0.0, 5.0)] | None, 3, 3.0),
        (Annotated[int, Range(0, 5)] | None, 3, 3),
        (Mapping[str, Setting], {"a": 3}, {"a": 3}),
        (Path, "a", Path("a")),
        (Path | None, "a", Path("a")),
        (bool, True, True),
        (Any, [3], [3]),
    ],
    ids=str,
)
def test_numbers_keep_their_type_where_it_has_a_choice_and_get_it_where_not(
    kind: Any, value: object, expected: object
) -> None:
    value = read(kind, value, SOURCE)
    assert value == expected
    assert repr(value) == repr(expected)


CIRCLE = {KIND: "Circle", "centre": {"x": 1.0}}


@pytest.mark.parametrize(
    ("kind", "value", "place"),
    [
        (int, 3.0, ""),
        (int, True, ""),
        (int, "3", ""),
        (float, "3", ""),
        (float, False, ""),
        (bool, 1, ""),
        (bool, None, ""),
        (str, 3, ""),
        (str, None, ""),
        (Path, "", ""),
        (Path, 3, ""),
        (Setting, True, ""),
        (Setting, [3], ""),
        (float | tuple[float, ...], "3", ""),
        (float | tuple[float, ...], ["3"], "[0]"),
        (Literal["a", "b"], "c", ""),
        (Literal["a", 1], True, ""),
        (Literal["a", "b"], ["a"], ""),
        (tuple[int, ...], 3, ""),
        (tuple[int, ...], "34", ""),
        (tuple[int, ...], [3, 4.5], "[1]"),
        (tuple[int, int], [3], ""),
        (tuple[int, int], [3, 4, 5], ""),
        (Mapping[str, int], [3], ""),
        (Mapping[str, int], {"a": "3"}, "a"),
        (Mapping[Annotated[str, Text("[a-z]+", "small letters")], int], {"A": 3}, "A"),
        (Mapping[str, tuple[int, ...]], {"a": [3, "4"]}, "a[1]"),
        (Annotated[int, Range(1, 5)], 6, ""),
        (Annotated[float, Range(0.0, 5.0, above=True)], 0, ""),
        (Annotated[float, Range(0.0, 5.0)], None, ""),
        (Annotated[int, Range(1, 5)] | None, 0, ""),
        (Annotated[str, Text("[a-z]+", "small letters")], "aA", ""),
        (Annotated[str, Text("[a-z]+", "small letters")], "a\n", ""),
        (Annotated[str, Text("[a-z]+", "small letters")], 3, ""),
        (Circle, [3], "content"),
        (Circle, {}, "centre"),
        (Circle, {"centre": {}}, "centre.x"),
        (Circle, {"centre": {"x": 1, "z": 2}}, "centre.z"),
        (Circle, {"centre": [1, 2]}, "centre"),
        (Circle, {"centre": {"x": 1}, "radius": 10}, "radius"),
        (Drawing, {"shape": CIRCLE, "bits": [3]}, "bits"),
        (Drawing, {"shape": {**CIRCLE, "radius": "3"}}, "shape.radius"),
        (Drawing, {"shape": {KIND: "Polygon", "corners": [{"x": 1}, {"x": None, "y": "2"}]}}, "shape.corners[1].y"),
        (Drawing, {"shape": CIRCLE, "files": {"a": 3}}, "files.a"),
        (Drawing, {"shape": 3}, "shape"),
        (Drawing, {"shape": None}, "shape"),
        (Drawing, {"shape": {"centre": {"x": 1}}}, "shape.kind"),
        (Drawing, {"shape": {KIND: "Square"}}, "shape.kind"),
        (Drawing, {"shape": {KIND: ["Circle"]}}, "shape.kind"),
    ],
    ids=str,
)
def test_what_does_not_fit_is_refused_with_its_place(kind: Any, value: object, place: str) -> None:
    with pytest.raises(InputError) as refusal:
        read(kind, value, SOURCE)
    assert (refusal.value.source, refusal.value.field) == (SOURCE, place)


def test_a_place_begins_with_that_of_the_value() -> None:
    with pytest.raises(InputError) as refusal:
        read(Circle, {"centre": {"x": "1"}}, SOURCE, "shapes.sun")
    assert refusal.value.field == "shapes.sun.centre.x"
    with pytest.raises(InputError) as refusal:
        read(Circle, {}, SOURCE, "shapes.sun")
    assert refusal.value.field == "shapes.sun.centre"


@pytest.mark.parametrize(("key", "expected"), [("radios", "radius?"), ("zzz", "one of centre, radius")])
def test_an_unknown_key_is_refused_with_the_nearest_or_all_known_ones(key: str, expected: str) -> None:
    with pytest.raises(InputError) as refusal:
        read(Circle, {"centre": {"x": 1}, key: 3}, SOURCE)
    assert (refusal.value.field, refusal.value.expected) == (key, expected)


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("3", "'3'"),
        (3, "3"),
        (True, "true"),
        (None, "null"),
        ([1, "a"], '[1, "a"]'),
        ({}, "nothing"),
        ({1: 2}, "a mapping"),
    ],
    ids=str,
)
def test_a_refusal_shows_a_value_as_its_file_holds_it(value: object, shown: str) -> None:
    assert codec.shown(value) == shown


def is_valid(kind: Any, value: object) -> bool:
    return Draft202012Validator(schema(kind)).is_valid(value)


def is_read(kind: Any, value: object) -> bool:
    try:
        read(kind, value, SOURCE)
    except InputError:
        return False
    return True


CHOICES = {
    "text": (str, ["a", 3, None]),
    "path": (Path, ["a", 3]),
    "whole number": (int, [3, 3.5, "3", True]),
    "number": (float, [3, 3.5, "3", True]),
    "bool": (bool, [True, 1, "true"]),
    "literal": (Literal["a", "b"], ["a", "c", 3]),
    "list": (tuple[int, ...], [[], [3], ["3"], 3]),
    "list of two": (tuple[int, int], [[3, 4], [3], [3, 4, 5]]),
    "mapping": (Mapping[str, int], [{"a": 3}, {"a": "3"}, 3]),
    "named keys": (Mapping[Annotated[str, Text("[a-z]+", "small letters")], int], [{"a": 3}, {"A": 3}]),
    "settings": (Setting, [3, 3.5, "3", True, [3]]),
    "or none": (Annotated[int, Range(1, 5)] | None, [3, None, 0, 6, "3"]),
    "or list": (float | tuple[float, ...], [3, [3], ["3"], "3"]),
    "range": (Annotated[float, Range(0.0, 5.0)], [0, 5, 5.1, -0.1]),
    "range above": (Annotated[float, Range(0.0, 5.0, above=True)], [0, 1e-9, 5, 5.1]),
    "pattern": (Annotated[str, Text("a|bc", "a or bc")], ["a", "bc", "ac", "abc", "b", ""]),
    "class": (Circle, [{"centre": CIRCLE["centre"]}, {"centre": {"x": 1}, "radius": 0}, {"centre": {"x": 1}, "r": 1}]),
    "needed": (Point, [{}, {"x": 1}, {"y": 1}, 3]),
    "rest": (Brush, [{"a": 3, "width": 0.5}, {"a": [3]}, {"width": "a"}, 3]),
}


@pytest.mark.parametrize(("kind", "values"), CHOICES.values(), ids=CHOICES)
def test_a_schema_admits_what_is_read_and_nothing_else(kind: Any, values: list[Any]) -> None:
    admitted = [is_valid(kind, value) for value in values]
    assert admitted == [is_read(kind, value) for value in values]
    assert any(admitted)
    assert not all(admitted)


def test_a_schema_has_descriptions_and_defaults() -> None:
    content = schema(Circle)["properties"]
    assert content["radius"]["description"] == "Radius in metres."
    assert content["radius"]["default"] == 1.0
    assert "default" not in content["centre"]


def test_the_schema_of_the_configuration_is_that_of_its_file() -> None:
    assert (ROOT / "schemas" / "config.schema.json").read_text() == schema_text()
    Draft202012Validator.check_schema(json.loads(schema_text()))


Place = tuple[str, ...]


def bounded(hint: Any, place: Place = ()) -> Iterator[tuple[Place, Range]]:
    """Yield the place of every number with bounds below a type, and its bounds; entries of mappings are named ``a``."""
    arguments = get_args(hint)
    if get_origin(hint) is Annotated:
        yield from ((place, rule) for rule in arguments[1:] if isinstance(rule, Range))
        yield from bounded(arguments[0], place)
    elif get_origin(hint) is Mapping:
        yield from bounded(arguments[1], (*place, "a"))
    elif get_origin(hint) is UnionType:
        for member in arguments:
            yield from bounded(member, place)
    elif is_dataclass(hint):
        for name, inner in codec.hints(hint).items():
            yield from bounded(inner, (*place, name))


def content_with(place: Place, value: object) -> dict[str, Any]:
    """Return the content of a configuration with one entry, and what it needs beside."""
    name, *inner = place
    content = {name: content_with(tuple(inner), value) if inner else value}
    return content | ({"command": "mark"} if name == "timeout" else {})


BOUNDED = dict(bounded(Config))
CONFIG_SCHEMA = Draft202012Validator(schema(Config))


@pytest.mark.parametrize(("place", "limits"), BOUNDED.items(), ids=map(".".join, BOUNDED))
def test_schema_and_reader_of_the_configuration_agree_on_bounds(place: Place, limits: Range) -> None:
    numbers = [limits.least, limits.most, limits.least - 1, limits.most + 1]
    contents = [content_with(place, number) for number in numbers]
    assert [is_read(Config, content) for content in contents] == [not limits.above, True, False, False]
    assert [CONFIG_SCHEMA.is_valid(content) for content in contents] == [not limits.above, True, False, False]


TEXTS = st.text(max_size=5)
PATHS = st.text(min_size=1, max_size=5).map(Path)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
SETTINGS = st.dictionaries(TEXTS, st.integers() | NUMBERS | TEXTS, max_size=3)
FACTORS = st.floats(0.0, 1e6, exclude_min=True)
METHODS = st.builds(MethodSettings, tau_n=st.none() | FACTORS, views=st.none() | st.integers(1, 9))
ATTACKS = st.builds(
    AttackSpec,
    name=TEXTS,
    settings=SETTINGS,
    seed=st.integers(),
    damage=st.none() | NUMBERS,
    measured=st.dictionaries(TEXTS, PATHS, max_size=2),
)
OWNERS = st.builds(Owner, TEXTS, PATHS, PATHS, st.sampled_from(["picture", "bits"]), published=st.none() | PATHS)
JOBS = st.builds(
    Job,
    model=st.builds(ModelId, TEXTS, TEXTS, st.integers()),
    variant=TEXTS,
    public=PATHS,
    case=ATTACKS | st.builds(Control, TEXTS, st.none() | METHODS),
    views=st.builds(Views, PATHS, st.sampled_from(["train", "test", "all"]), PATHS),
    owner=st.none() | OWNERS,
    rendered=st.lists(TEXTS, max_size=2).map(tuple),
    inputs=st.lists(PATHS, max_size=2).map(tuple),
)


@given(JOBS)
def test_any_job_survives_a_round_trip(job: Job) -> None:
    line = codec.text(job)
    assert "\n" not in line
    assert parsed(Job, line) == job


def test_a_whole_plan_survives_a_round_trip(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    plan = plan_of(
        {
            "assets": {"bot": {"model": "README.md", "cameras": "orbit"}},
            "pairs": {"raised": {}, "front": {"message": "room", "placement": "front"}},
            "schemes": {"planted": {"gaussians": 600}, "secure_gs": {}, "marked_clones": {}},
            "repetitions": 2,
            "detectors": {"mark": {"command": "python mark.py", "message": "0110"}},
            "decisions": {"mild": {"tau_n": 1.5}, "leaf": {"selection": "leaf", "views": 3}},
            "variants": {
                "unattacked": {},
                "gspure": {},
                "mild": {"attack": "gspure", "decision": "mild"},
                "noise": {"attack": "gaussian_noise", "damage": [0.5, 2]},
            },
        }
    )
    copy = parsed(Plan, codec.text(plan))
    assert copy == plan
    assert repr(copy) == repr(plan)
