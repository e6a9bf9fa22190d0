"""Numbers as text: rounding changes no statement, and every number that people read is written by one module."""

import ast
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.progress import decimal, percent, signed, significant
from tests.test_layers import PACKAGE, TREES, part_of

ROUNDED = re.compile(r"[%f]$")  # a format with a fixed number of decimals
FORMAT = re.compile(r"\{:[^{}]*[%f]\}")  # the same in a text for `str.format`
EXACT = {"numerals.py", "progress.py"}  # the module itself; times of jobs
SHOWN = {"method", "evaluation", "figures", "report"}  # parts whose numbers are results


@pytest.mark.parametrize(
    ("share", "text"),
    [
        *zip(
            [0, 1, 0.0004, 0.9996, 0.0006, 0.9994, 1.03, -0.0, math.nan, math.inf],
            ["0.0%", "100.0%", "<0.1%", ">99.9%", "0.1%", "99.9%", "103.0%", "0.0%", "–", "–"],
            strict=True,
        )
    ],
)
def test_only_none_and_all_are_0_and_100_percent(share: float, text: str) -> None:
    assert percent(share) == text


@given(st.floats(0, 1), st.integers(0, 4))
def test_a_share_rounds_to_none_or_all_only_if_it_is(share: float, decimals: int) -> None:
    text = percent(share, decimals)
    assert (text == percent(0, decimals)) == (share == 0)
    assert (text == percent(1, decimals)) == (share == 1)


@pytest.mark.parametrize(
    ("value", "plain", "change"),
    [
        *zip(
            [1.001, -2.25, -0.001, -0.0, math.nan, math.inf, -math.inf, 1e9],
            ["1.00", "−2.25", "0.00", "0.00", "–", "∞", "−∞", "1.00e+09"],
            ["+1.00", "−2.25", "+0.00", "+0.00", "–", "–", "–", "+1.00e+09"],
            strict=True,
        )
    ],
)
def test_zero_has_no_sign_and_unknown_numbers_are_dashes(value: float, plain: str, change: str) -> None:
    assert (decimal(value), signed(value)) == (plain, change)


@pytest.mark.parametrize(
    ("value", "text"), [(0.00431, "0.00431"), (53.125, "53.1"), (-0.0, "0"), (-4e-5, "−4e−05"), (math.nan, "–")]
)
def test_numbers_of_unknown_magnitude_keep_their_first_digits(value: float, text: str) -> None:
    assert significant(value) == text


def formats() -> list[str]:
    """The formats of numbers in sources and templates that round outside of the module for it."""
    listed = []
    for source, tree in TREES.items():
        for node in ast.walk(tree):
            spec = node.format_spec if isinstance(node, ast.FormattedValue) else None
            text = (
                "".join(part.value if isinstance(part, ast.Constant) else "0" for part in spec.values) if spec else ""
            )
            if ROUNDED.search(text) and source.name not in EXACT and (text[-1] == "%" or part_of(source) in SHOWN):
                listed.append(f"{source.relative_to(PACKAGE)}:{node.lineno}: {text}")
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and FORMAT.search(node.value):
                listed.append(f"{source.relative_to(PACKAGE)}:{node.lineno}: {node.value}")
    for template in (PACKAGE / "report" / "templates").iterdir():
        listed += [
            f"{template.name}: {spec}" for spec in re.findall(r'"%[^"]*"\s*\|format|round\(', template.read_text())
        ]
    return listed


def test_results_are_rounded_by_one_module() -> None:
    assert formats() == []
