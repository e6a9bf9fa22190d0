"""GSPure against other attacks, also at equal damage, and the table of survival."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.evaluation.contest import MESSAGE_DROP, SCENE_DROP, SCORE, contest, leads
from gspure.evaluation.matched import MATCHED_DAMAGES, match, pareto_front
from gspure.evaluation.outcomes import Outcome
from gspure.report.attack_tables import matched_table
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


def test_the_lead_is_over_the_best_attack_that_costs_at_most_the_damage_in_most_scenes() -> None:
    drops = {"gspure@1dB": (1.0, 10.0), "gof@1dB": (1.3, 30.0), "gof": (0.8, 6.0), "noise@1dB": (0.98, 3.0)}
    scenes = {
        name: {**drops, "half": (0.0, 9.0 + i), "rare": (0.5 if i == 0 else 3.0, 20.0)} for i, name in enumerate("abc")
    }
    attacks = {"gspure": ["gspure@1dB"], "gof": ["gof", "gof@1dB"], "gaussian_noise": ["noise@1dB"]}
    attacks |= {"quantize": ["half"], "crop": ["rare"]}
    every, paper = leads(benchmark(scenes), attacks)
    assert (every.against, every.attack, every.is_bound) == ("all", "quantize", True)
    assert every.difference == (0.0, -1.0, 1.0, 0.75, 3)
    assert (paper.against, paper.attack, paper.is_bound, paper.difference.mean) == ("paper", "gof", True, 4.0)
    (exact,) = (row for row in leads(benchmark(scenes), {"gspure": ["gspure@1dB"], "x": ["noise@1dB"]}))
    assert (exact.attack, exact.is_bound, exact.difference.mean) == ("x", False, 7.0)


SWEEPS = {"ours": ["weak", "strong"], "theirs": ["other", "absent"]}


def outcomes(**drops: dict[str, tuple[float, float]]) -> list[Outcome]:
    """Variants by scene, each with the drops of scene and message; without controls."""
    return [o for o in benchmark(drops) if not o.is_control]


TWO = outcomes(
    room={"weak": (1.0, 10.0), "strong": (3.0, 20.0), "other": (2.0, 2.0)},
    vault={"weak": (1.0, 6.0), "strong": (1.5, 8.0), "other": (2.0, 4.0)},
)


def cells(rows, sweep):
    return {row.damage: row for row in rows if row.sweep == sweep}


def test_the_drop_is_interpolated_in_every_scene_and_then_averaged() -> None:
    ours = cells(match(TWO, SWEEPS), "ours")
    assert tuple(ours) == MATCHED_DAMAGES[2:]  # at less, even the weakest does more to some scene
    assert ours[1.5].drop.mean == pytest.approx((12.5 + 8.0) / 2)
    assert (ours[1.5].strengths, ours[1.5].gentle) == (2, 0)


def test_the_largest_drop_counts_where_no_strength_reaches_the_damage() -> None:
    rows = match(TWO, SWEEPS)
    ours = cells(rows, "ours")[2.0]
    theirs = cells(rows, "theirs")[2.0]
    assert ours.drop.mean == pytest.approx((15.0 + 8.0) / 2)
    assert (ours.gentle, theirs.gentle) == (1, 0)
    shown = {str(row.cells[0]): row.cells[-1] for row in matched_table(rows, {}).rows}
    assert str(shown["ours"]) == "≥ 11.50 (8.00 to 15.00) at 1.75 dB"
    assert (shown["ours"].best, shown["theirs"].best) == (True, False)


AIMED = {"pruning": ["half", "pruning@1dB", "pruning@2dB"], "noise": ["noise@1dB", "noise@2dB"]}


def test_strengths_searched_for_a_damage_are_read_not_interpolated() -> None:
    drops = {"half": (1.0, 30.0), "pruning@1dB": (1.03, 10.0), "pruning@2dB": (0.7, 7.0)}
    drops |= {"noise@1dB": (0.98, 2.0), "noise@2dB": (2.6, 3.0), "gof": (4.0, 8.0)}
    rows = match(outcomes(room=drops), AIMED)
    assert [*cells(rows, "noise")] == [1.0, 2.0]
    shown = {(row.sweep, row.damage): (row.drop.mean, row.gentle, round(row.scene_drop, 9)) for row in rows}
    assert shown == {
        ("pruning", 1.0): (10.0, 0, 1.0),
        ("pruning", 2.0): (7.0, 1, 0.7),
        ("noise", 1.0): (2.0, 0, 1.0),
        ("noise", 2.0): (3.0, 0, 2.6),
    }
    texts = {str(row.cells[0]): str(row.cells[-1]) for row in matched_table(rows, {}).rows}
    assert texts == {"pruning": "≥ 7.00 at 0.70 dB", "noise": "≤ 3.00 at 2.60 dB"}


POINTS = st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), min_size=1, max_size=12)


@given(POINTS)
def test_the_front_is_what_brute_force_finds(points):
    front = [not any(x <= a and y <= b and (x, y) != (a, b) for x, y in points) for a, b in points]
    assert pareto_front(*zip(*points, strict=True)).tolist() == front
