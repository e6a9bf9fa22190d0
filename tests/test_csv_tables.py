"""The codec of result files: typed tables as CSV and back."""

import math
from pathlib import Path
from typing import Literal, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.errors import InputError
from gspure.metrics.csv_tables import Drops, Values, read_table, write_table
from gspure.metrics.image_metrics import METRICS


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
    OF_METRICS,
    OF_METRICS,
)
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
    with pytest.raises(InputError, match=r"r\.csv: (file|header|row): expected") as caught:
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
