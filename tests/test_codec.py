"""Codecs: of configurations, plans and results, with exact numbers, refusals and schemas; and of tables as CSV."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from gspure import codec
from gspure.codec import KIND, REST, Text, plain, read, schema
from gspure.errors import InputError
from gspure.metrics.csv_tables import Drops, Values, read_table, write_table
from gspure.metrics.image_metrics import METRICS
from gspure.settings import Range, Setting
from gspure.workflow.config import SchemeConfig
from gspure.workflow.schema import schema_text
from tests.workflow_cases import ROOT

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


SUN = Drawing(Circle(Point(1.0, 2.0)))
DRAWINGS = {
    "defaults": SUN,
    "another class": replace(SUN, shape=Polygon((Point(0.0), Point(1e-300, -0.0)), is_closed=False)),
    "literal number": replace(SUN, kind_of_paper=7),
    "paths": replace(SUN, files={"a": Path("b/c d.png"), "é": Path("/é")}),
    "number or none": replace(SUN, limit=0.1),
    "number or list": replace(SUN, levels=(0.25, 3.0)),
    "class or none": replace(SUN, backdrop=Polygon()),
    "rest": replace(SUN, settings={"bits": 3, "tau": 3.0, "level": "3", "codec": "é\n"}),
}


@pytest.mark.parametrize("drawing", DRAWINGS.values(), ids=DRAWINGS)
def test_a_value_survives_a_round_trip_as_one_line_without_escaped_letters(drawing: Drawing) -> None:
    line = codec.text(drawing)
    assert read(Drawing, json.loads(line), SOURCE) == drawing
    assert "\n" not in line
    assert "\\u" not in line


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_is_null_and_comes_back_as_nan(number: float) -> None:
    content = plain(replace(SUN, mean=number))
    assert content["mean"] is None
    assert math.isnan(read(Drawing, content, SOURCE).mean)


def test_entries_with_a_default_may_be_left_out_of_a_content_that_stays_as_it_is() -> None:
    content = {"shape": {KIND: "Circle", "centre": {"x": 1, "y": 2}}}
    assert read(Drawing, content, SOURCE) == SUN
    assert content == {"shape": {KIND: "Circle", "centre": {"x": 1, "y": 2}}}
    assert read(Drawing, content, SOURCE).settings is not read(Drawing, content, SOURCE).settings
    assert read(Point, {"x": 1}, SOURCE) == Point(1.0)


LETTERS = Annotated[str, Text("[a-z]+", "small letters")]
FROM_ONE = Annotated[int, Range(1, 5)]
TO_FIVE = Annotated[float, Range(0.0, 5.0)]
ABOVE_ZERO = Annotated[float, Range(0.0, 5.0, above=True)]
CIRCLE = {"centre": {"x": 1.0, "y": 0.5}, "radius": 1.0}
SHAPE = {**CIRCLE, KIND: "Circle"}


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        (float, 3, 3.0),
        (float | tuple[float, ...], [3], (3.0,)),
        (tuple[float, ...], (3, 4), (3.0, 4.0)),
        (Path | None, "a", Path("a")),
        (Any, [3], [3]),
        (Polygon | None, {}, Polygon()),
    ],
    ids=str,
)
def test_what_is_read_has_the_type_that_leaves_no_choice(kind: Any, value: object, expected: object) -> None:
    assert repr(read(kind, value, SOURCE)) == repr(expected)


def refusal_of(kind: Any, value: object, place: str = "") -> InputError:
    with pytest.raises(InputError) as refusal:
        read(kind, value, SOURCE, place)
    assert refusal.value.source == SOURCE
    return refusal.value


@pytest.mark.parametrize(
    ("kind", "admitted", "refused"),
    [
        (str, ["a", ""], [3, None]),
        (int, [3], [3.5, "3", True]),
        (float, [3.5], ["3", True, False]),
        (bool, [True], [1, None, "true"]),
        (Literal["a", "b"], ["a"], ["c", 3, ["a"]]),
        (Literal["a", 1], [1], [True]),
        (tuple[int, ...], [[], [3]], [3, "34", ["3"], [3, 4.5]]),
        (tuple[int, int], [[3, 4]], [[3], [3, 4, 5]]),
        (Mapping[str, int], [{"a": 3}], [3, [3], {"a": "3"}]),
        (Setting, [3, 3.0, "3"], [True, [3]]),
        (float | tuple[float, ...], [3.5, [3.5]], ["3", ["3"]]),
        (FROM_ONE, [1, 5], [0, 6]),
        (FROM_ONE | None, [3, None], [0, 6, "3"]),
        (TO_FIVE, [0.0, 5.0], [5.1, -0.1, None]),
        (ABOVE_ZERO, [1e-9, 5.0], [0, 5.1]),
        (LETTERS, ["a"], ["aA", "", 3]),
        (Annotated[str, Text("a|bc", "a or bc")], ["a", "bc"], ["ac", "abc", "b", ""]),
        (Circle, [CIRCLE], [3, {}, {"centre": {}}, {**CIRCLE, "r": 1}, {**CIRCLE, "radius": 0}]),
        (
            SchemeConfig,
            [{"bits": 3, "tau": 0.5, "settings": 4, "seed": 1, "clean_models": 2}],
            [3, {"bits": [3]}, {"seed": "a"}],
        ),
    ],
    ids=str,
)
def test_reader_and_schema_admit_and_refuse_the_same(kind: Any, admitted: list[Any], refused: list[Any]) -> None:
    is_valid = Draft202012Validator(schema(kind)).is_valid
    assert repr([plain(read(kind, value, SOURCE)) for value in admitted]) == repr(admitted)
    assert all(is_valid(value) for value in admitted)
    for value in refused:
        refusal_of(kind, value)
        assert not is_valid(value)


@pytest.mark.parametrize(
    ("kind", "value", "place"),
    [
        (Path, "", ""),
        (LETTERS, "a\n", ""),
        (Mapping[LETTERS, int], {"A": 3}, "A"),
        (Mapping[str, tuple[int, ...]], {"a": [3, "4"]}, "a[1]"),
        (Circle, {}, "centre"),
        (Circle, {"centre": {"x": 1, "z": 2}}, "centre.z"),
        (Drawing, {"shape": SHAPE, "bits": [3]}, "bits"),
        (Drawing, {"shape": {KIND: "Polygon", "corners": [{"x": 1}, {"x": None, "y": "2"}]}}, "shape.corners[1].y"),
        (Drawing, {"shape": 3}, "shape"),
        (Drawing, {"shape": CIRCLE}, "shape.kind"),
        (Drawing, {"shape": {KIND: "Square"}}, "shape.kind"),
        (Drawing, {"shape": {KIND: ["Circle"]}}, "shape.kind"),
        (Circle | Polygon, 3, "content"),
    ],
    ids=str,
)
def test_a_refusal_names_the_place_of_the_entry(kind: Any, value: object, place: str) -> None:
    assert refusal_of(kind, value).field == place


def test_a_place_begins_with_that_of_the_value() -> None:
    assert refusal_of(Circle, {"centre": {"x": "1"}}, "shapes.sun").field == "shapes.sun.centre.x"


@pytest.mark.parametrize(("key", "expected"), [("radios", "radius?"), ("zzz", "one of centre, radius")])
def test_an_unknown_key_is_refused_with_the_nearest_or_all_known_ones(key: str, expected: str) -> None:
    refusal = refusal_of(Circle, {"centre": {"x": 1}, key: 3})
    assert (refusal.field, refusal.expected) == (key, expected)


def test_the_schema_of_the_configuration_is_that_of_its_file() -> None:
    assert (ROOT / "config" / "config.schema.json").read_text() == schema_text()
    Draft202012Validator.check_schema(json.loads(schema_text()))


class Part(NamedTuple):
    low: float
    count: int


class Sample(NamedTuple):
    name: str
    kind: Literal["a", "b"]
    count: int
    views: int | None
    number: float
    known: bool | None
    part: Part
    second: Part | None
    values: Values
    drops: Drops


COLUMNS = "name,kind,count,views,number,known,part_low,part_count,second_low,second_count,"
COLUMNS += ",".join([*METRICS, *(f"{metric}_drop" for metric in METRICS)])
NUMBERS = st.one_of(st.just(math.inf), st.floats(-99, 99))
PARTS = st.builds(Part, NUMBERS, st.integers(0, 9))
OF_METRICS = st.one_of(st.just({}), st.fixed_dictionaries(dict.fromkeys(METRICS, NUMBERS)))
KNOWN = {"name": st.text('ab,"\n ', max_size=5), "number": NUMBERS, "part": PARTS, "second": st.none() | PARTS}
SAMPLES = st.builds(Sample, values=OF_METRICS, drops=OF_METRICS, **KNOWN)
ONE = Sample("x", "a", 1, None, 0.5, True, Part(1.0, 2), None, {**dict.fromkeys(METRICS, 0.9), "psnr": 30.0}, {})


@given(st.lists(SAMPLES, max_size=4))
def test_rows_read_back_are_those_written(tmp_path_factory, rows: list[Sample]) -> None:
    path = tmp_path_factory.mktemp("tables") / "r.csv"
    write_table(path, Sample, rows)
    assert read_table(path, Sample) == rows


def test_columns_follow_from_the_types_and_unknown_numbers_are_empty(tmp_path: Path) -> None:
    write_table(tmp_path / "r.csv", Sample, [ONE._replace(number=math.nan)])
    metrics = ["30", *("0.9" for metric in METRICS if metric != "psnr")]
    drops = ["" for _ in METRICS]
    line = ",".join(["x,a,1,,,true,1,2,,", *metrics, *drops])
    assert (tmp_path / "r.csv").read_text() == f"{COLUMNS}\n{line}\n"
    assert math.isnan(read_table(tmp_path / "r.csv", Sample)[0].number)


@pytest.mark.parametrize("line", ["", "x", "x,c,1,,1,true,1,2,,", "x,a,1,,one,true,1,2,,", "x,a,1,,1,true,,,,"])
def test_a_corrupt_table_is_refused_in_one_line(tmp_path: Path, line: str) -> None:
    rest = "," * 2 * len(METRICS) if line.count(",") > 1 else ""
    (tmp_path / "r.csv").write_text(f"{COLUMNS}\n{line}{rest}\n" if line else "")
    with pytest.raises(InputError, match=r"r\.csv: (file|header|row( 1)?): expected") as caught:
        read_table(tmp_path / "r.csv", Sample)
    assert "\n" not in str(caught.value)


def test_a_metric_that_a_table_was_written_without_is_unknown(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    write_table(path, Sample, [ONE])
    first, row = (line.split(",") for line in path.read_text().splitlines())
    place = first.index("ms_ssim")
    path.write_text("\n".join(",".join([*line[:place], *line[place + 1 :]]) for line in (first, row)))
    (known,) = read_table(path, Sample)
    assert known.values == {name: value for name, value in ONE.values.items() if name != "ms_ssim"}
    path.write_text(",".join(first[1:]) + "\n")
    with pytest.raises(InputError, match="header"):
        read_table(path, Sample)
