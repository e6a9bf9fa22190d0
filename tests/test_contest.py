"""GSPure against every other attack: differences in the same scenes and seeds, their test, and the tables of them."""

import math

import numpy as np
import pytest

from gspure.evaluation.contest import MESSAGE_DROP, SCENE_DROP, SCORE, contest
from gspure.evaluation.matched import MATCHED_DAMAGES
from gspure.evaluation.survival import survival
from gspure.report.attack_tables import conditions_markdown, other_attacks_table, survival_table
from tests.contest_cases import attacked, benchmark

SCENES = benchmark(
    {
        f"s{i}": {"gspure": (1.0, 10.0 + i), "weaker": (2.0, 4.0), "twin": (1.0, 10.0 + i), "better": (0.5, 12.0 + i)}
        for i in range(6)
    }
)


def by_attack(rows, quantity=SCORE):
    return {row.attack: row for row in rows if row.quantity == quantity and math.isnan(row.damage)}


def test_each_attack_is_compared_in_score_message_and_scene() -> None:
    rows = contest(SCENES, {})
    assert {row.attack for row in rows} == {"weaker", "twin", "better"}
    assert by_attack(rows)["weaker"].difference.mean == pytest.approx(6.0 + 2.5 + 1.0)
    assert by_attack(rows, MESSAGE_DROP)["weaker"].difference.mean == pytest.approx(8.5)
    assert by_attack(rows, SCENE_DROP)["weaker"].difference.mean == pytest.approx(-1.0)
    assert by_attack(rows)["better"].difference.mean == pytest.approx(-2.5)


def test_p_values_are_corrected_for_all_attacks_and_come_with_the_smallest_possible() -> None:
    rows = by_attack(contest(SCENES, {}))
    assert rows["better"].p == 2 / 2**6
    assert rows["better"].p_adjusted == pytest.approx(3 * 2 / 2**6)
    assert [row.p_attainable for row in rows.values()] == pytest.approx([3 * 2 / 2**6] * 3)
    assert all(math.isnan(row.p) for row in contest(SCENES, {}) if row.quantity != SCORE)


def test_seeds_of_a_scene_belong_together_and_are_counted_as_cells() -> None:
    drops = {scene: {"gspure": (1.0, 10.0), "x": (1.0, 7.0)} for scene in "ab"}
    once, often = (by_attack(contest(benchmark(drops, seeds), {}))["x"] for seeds in (1, 3))
    assert (once.cells, often.cells) == (2, 6)
    assert (once.difference.scenes, once.p) == (often.difference.scenes, often.p) == (2, 0.5)


def test_only_scenes_and_seeds_that_both_have_are_compared() -> None:
    outcomes = benchmark({scene: {"gspure": (1.0, 10.0), "x": (1.0, 7.0)} for scene in "abc"})
    without = [o for o in outcomes if (o.scene, o.variant) != ("b", "x")] + [attacked("x", 0.0, 0.0, "b", 7)]
    (row,) = by_attack(contest(without, {})).values()
    assert (row.cells, row.difference.scenes, row.difference.mean) == (2, 2, 3.0)


def test_at_equal_damage_the_sweeps_are_compared_scene_by_scene() -> None:
    outcomes = benchmark(
        {
            "a": {"gspure": (0.6, 10.0), "tau_2": (2.5, 12.0), "weak": (0.5, 4.0), "strong": (2.5, 10.0)},
            "b": {"gspure": (2.0, 10.0)},
        }
    )
    sweeps = {"gspure": ["gspure", "tau_2"], "theirs": ["weak", "strong", "absent"]}
    rows = [row for row in contest(outcomes, sweeps) if not math.isnan(row.damage)]
    # At 0.3 dB, neither was tested so gently.
    assert [(row.attack, row.damage, row.cells) for row in rows] == [("theirs", at, 1) for at in MATCHED_DAMAGES[1:]]
    ours = np.interp(MATCHED_DAMAGES[1:], [0.6, 2.5], [10, 12])
    assert [row.difference.mean for row in rows] == pytest.approx(ours - [4.6, 7, 8.5])


def test_the_tables_hold_survival_and_differences() -> None:
    table = survival_table(survival(SCENES))
    titles = [column.title for column in table.columns]
    left = {str(row.cells[0]): dict(zip(titles, map(str, row.cells), strict=True)) for row in table.rows}
    assert left["better"]["message"].startswith("14.50 [")
    assert left["better"]["survived"] == "6 of 6"
    rows = other_attacks_table([row for row in contest(SCENES, {}) if math.isnan(row.damage)], {}).rows
    others = {str(row.cells[0]): row.cells for row in rows}
    assert str(others["better"][1]).startswith("−2.50 [")
    assert str(others["better"][-1]) == "0.094 (≥ 0.094)"
    assert conditions_markdown([], [], []).startswith("No model with a message")
