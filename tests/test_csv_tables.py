"""The codec of result files: typed tables as CSV and back."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.artifacts.checksums import forget
from gspure.errors import InputError
from gspure.evaluation.csv_tables import PerMetric, Values, read_table, write_table
from gspure.evaluation.metrics import METRICS, Metric
from gspure.settings import Share


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
    other: Part | None
    values: Values
    drops: Annotated[Mapping[str, float], PerMetric("{}_drop", differences=True)]
    share: Share = 0.5


DROPS = [f"{metric}_drop" for metric in METRICS]
COLUMNS = ",".join(
    ["name,kind,count,views,number,known,part_low,part_count,other_low,other_count", *METRICS, *DROPS, "share"]
)
NUMBERS = st.one_of(st.just(math.inf), st.floats(-99, 99))
PARTS = st.builds(Part, NUMBERS, st.integers(0, 9))
DIFFERENCES = st.one_of(st.just({}), st.fixed_dictionaries(dict.fromkeys(METRICS, NUMBERS)))
POSSIBLE = {
    name: st.one_of(st.just(metric.identical), st.floats(metric.limits.least, metric.limits.most))
    for name, metric in METRICS.items()
}
SAMPLES = st.builds(
    Sample,
    st.text('ab,"\n ', max_size=5),
    st.sampled_from("ab"),
    st.integers(0, 9),
    st.none() | st.integers(0, 9),
    NUMBERS,
    st.none() | st.booleans(),
    PARTS,
    st.none() | PARTS,
    st.one_of(st.just({}), st.fixed_dictionaries(POSSIBLE)),
    DIFFERENCES,
    st.floats(0, 1),
)
ONE = Sample("x", "a", 1, None, 0.5, True, Part(1.0, 2), None, {**dict.fromkeys(METRICS, 0.9), "psnr": 30.0}, {})


@given(st.lists(SAMPLES, max_size=4))
def test_records_read_back_are_those_written(tmp_path_factory, rows: list[Sample]) -> None:
    path = tmp_path_factory.mktemp("tables") / "r.csv"
    write_table(path, Sample, rows)
    assert read_table(path, Sample) == rows


def test_columns_follow_from_the_types_and_unknown_numbers_are_empty(tmp_path: Path) -> None:
    write_table(tmp_path / "r.csv", Sample, [ONE._replace(number=math.nan)])
    metrics = ",0.9" * len(DROPS[1:]) + "," * len(DROPS) + ",0.5"
    assert (tmp_path / "r.csv").read_text() == f"{COLUMNS}\nx,a,1,,,true,1,2,,,30{metrics}\n"
    assert math.isnan(read_table(tmp_path / "r.csv", Sample)[0].number)


@pytest.mark.parametrize("number", ["1e400", "-1e400"])
def test_a_number_too_large_for_a_float_is_refused(tmp_path: Path, number: str) -> None:
    write_table(tmp_path / "r.csv", Sample, [ONE._replace(number=12345.5)])
    (tmp_path / "r.csv").write_text((tmp_path / "r.csv").read_text().replace("12345.5", number))
    forget(tmp_path / "r.csv")
    with pytest.raises(InputError, match=number):
        read_table(tmp_path / "r.csv", Sample)


def test_a_new_metric_is_a_column_of_every_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METRICS, "mse", Metric(lambda _a, _b: 0.0, "MSE", 3))
    write_table(tmp_path / "r.csv", Sample, [ONE._replace(values={**dict.fromkeys(METRICS, 1.0), "mse": 3.0})])
    header = (tmp_path / "r.csv").read_text().splitlines()[0].split(",")
    assert header[-2 * len(METRICS) - 1 : -1] == [*METRICS, *(f"{metric}_drop" for metric in METRICS)]
    assert "mse_drop" in header
    assert read_table(tmp_path / "r.csv", Sample)[0].values["mse"] == 3.0


@pytest.mark.parametrize("psnr", [0.0, 96.0, 197.0, math.inf])
@pytest.mark.parametrize("others", [0.0, 1.0, 1.0000000000000002])
def test_possible_metrics_are_read(tmp_path: Path, psnr: float, others: float) -> None:
    row = ONE._replace(values={**dict.fromkeys(METRICS, others), "psnr": psnr}, drops=dict.fromkeys(METRICS, -99.0))
    write_table(tmp_path / "r.csv", Sample, [row])
    assert read_table(tmp_path / "r.csv", Sample) == [row]


@pytest.mark.parametrize(
    ("column", "text"),
    [
        *(("psnr", text) for text in ("-5", "201", "1e300", "-inf", "nan", "1_2", "١٢", " 12")),
        *((name, text) for name in ("ssim", "nc", "structure") for text in ("7", "-1.1", "inf")),
        *(("ms_ssim", text) for text in ("-0.1", "1.1")),
        *(("share", text) for text in ("-0.1", "1.1", "inf", "0.1_1")),
        *(
            (name, text)
            for name in ("count", "views", "part_count")
            for text in ("-1", "1_2", "١٢", "1.0", str(2**53 + 1))
        ),
        ("count", ""),
        *((name, text) for name in ("number", "part_low", "psnr_drop") for text in ("1_2", "١٢", "nan", "12 ")),
    ],
)
def test_an_impossible_number_is_refused(tmp_path: Path, column: str, text: str) -> None:
    cells = dict(
        zip(COLUMNS.split(","), f"x,a,1,3,0.5,true,1,2,,,30{',0.9' * 5}{',1' * 6},0.5".split(","), strict=True)
    )
    (tmp_path / "r.csv").write_text(f"{COLUMNS}\n{','.join(cells.values())}\n")
    read_table(tmp_path / "r.csv", Sample)
    (tmp_path / "r.csv").write_text(f"{COLUMNS}\n{','.join((cells | {column: text}).values())}\n")
    with pytest.raises(InputError, match=r"r\.csv: file: expected"):
        read_table(tmp_path / "r.csv", Sample)


@pytest.mark.parametrize(
    "line",
    [
        "",
        "x",
        "x,c,1,,1,true,1,2,,,1,1,,",
        "x,a,one,,1,true,1,2,,,1,1,,",
        "x,a,1,,1,yes,1,2,,,1,1,,",
        "x,a,1,,1,true,,,,,1,1,,,9",
    ],
)
def test_a_corrupt_table_is_refused_in_one_line(tmp_path: Path, line: str) -> None:
    (tmp_path / "r.csv").write_text(f"{COLUMNS}\n{line}\n" if line else "")
    with pytest.raises(InputError, match=r"r\.csv: (file|header|row): expected") as caught:
        read_table(tmp_path / "r.csv", Sample)
    assert "\n" not in str(caught.value)
