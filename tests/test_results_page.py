"""Every decimal number of docs/results.md stands in a table that its section links, possibly with more digits."""

import csv
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
TABLES = sorted((DOCS / "tables").glob("*.csv"))
PAGE = (DOCS / "results.md").read_text(encoding="utf-8")
SECTIONS = {section.partition("\n")[0]: section for section in PAGE.split("\n## ")[1:]}
DECIMAL = re.compile(r"\d+\.\d+")


def numbers(table: Path) -> set[float]:
    """Return the sizes of all decimal numbers of a table."""
    return {float(number) for number in DECIMAL.findall(table.read_text(encoding="utf-8"))}


@pytest.mark.parametrize("section", SECTIONS)
def test_numbers_stand_in_a_linked_table(section: str) -> None:
    text = SECTIONS[section]
    known = set[float]().union(*(numbers(DOCS / link) for link in re.findall(r"\((tables/[\w-]+\.csv)\)", text)))
    for number in DECIMAL.findall(text):
        half = 0.5 * 10.0 ** -len(number.partition(".")[2]) + 1e-9
        assert any(abs(float(number) - value) <= half for value in known), number


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.stem)
def test_tables_are_rectangular_and_described(table: Path) -> None:
    with table.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert rows
    assert {len(row) for row in rows} == {len(header)}
    assert f"`{table.stem.partition('-')[0]}`" in (DOCS / "tables" / "README.md").read_text(encoding="utf-8")
