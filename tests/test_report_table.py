"""A table as data: the same cells in HTML, Markdown and LaTeX."""

import re
from html import unescape

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.metrics.statistics import Interval
from gspure.report.page import environment
from gspure.report.table import Cell, Column, Table, TableRow, interval

TABLE = Table(
    "Drops",
    [Column("attack"), Column("message", "PSNR drop"), Column("scene", "PSNR drop")],
    [
        TableRow([Cell("GSPure"), Cell("12.50", "(11.00 to 14.00)", best=True), Cell("1.00")], "best"),
        TableRow([Cell("clean <model>"), Cell(), Cell("−0.50")], "control"),
    ],
    "In dB.",
)


def page(table: Table) -> str:
    macros = environment().get_template("parts.html.j2").module
    return str(macros.table_of(table))


TEXTS = st.text(alphabet="ab |\\{}$&#_%~^-<>\"'", max_size=8).map(str.strip)


def cells_of_html(text: str) -> list[list[str]]:
    rows = re.findall(r"<tr.*?>(.*?)</tr>", text, flags=re.DOTALL)
    cells = [re.findall(r"<t[hd].*?>(.*?)</t[hd]>", row, flags=re.DOTALL) for row in rows]
    return [[unescape(re.sub(r"<[^>]*>", "", cell)) for cell in row] for row in cells]


def test_every_format_shows_the_same_cells() -> None:
    shown = [[str(cell) for cell in row.cells] for row in TABLE.rows]
    titles = ["attack", "PSNR drop message", "PSNR drop scene"]
    assert cells_of_html(page(TABLE)) == [titles, *shown]
    markdown = [[cell.strip(" *") for cell in line.strip("|").split("|")] for line in TABLE.markdown().splitlines()]
    assert [markdown[0], *markdown[2:]] == [titles, *shown]


@pytest.mark.parametrize(
    ("mean", "text"),
    [
        (Interval(1.0, 0.5, 1.5, 0.95, 6), "1.00 [0.50, 1.50]"),
        (Interval(1.0, -0.5, 1.5, 0.75, 3), "1.00 (−0.50 to 1.50) (3 of 6 scenes)"),
        (Interval(1.0, 1.0, 1.0, 0.0, 1), "1.00 (1 of 6 scenes)"),
        (None, "–"),
    ],
)
def test_intervals_have_brackets_ranges_parentheses_and_fewer_scenes_a_count(mean, text: str) -> None:
    assert str(interval(mean, 6)) == text


@given(TEXTS, TEXTS)
def test_no_character_of_a_text_is_markup(first: str, second: str) -> None:
    table = Table("t", [Column("a"), Column("b")], [TableRow([Cell(first), Cell(second)])])
    assert cells_of_html(page(table))[-1] == [first, second]
    assert len(re.findall(r"(?<!\\)\|", table.markdown().splitlines()[-1])) == 3
