"""Attacks at equal damage: their rows over scenes, and the table."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.evaluation.contest import contest
from gspure.evaluation.matched import MATCHED_DAMAGES, match, matched_message_drop, pareto_front, reached_name
from gspure.evaluation.names import variant_at, wanted_damage
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.survival import survival
from gspure.report.attack_tables import condition_tables, conditions_markdown, matched_table
from gspure.report.tables import model_table, summary_table
from tests.contest_cases import benchmark

SWEEPS = {"ours": ["weak", "strong"], "theirs": ["other", "absent"]}


def outcomes(**drops: dict[str, tuple[float, float]]) -> list[Outcome]:
    """Variants with what they take from scene and message, by scene; without controls."""
    return [o for o in benchmark(drops) if not o.is_control]


TWO = outcomes(
    room={"weak": (1.0, 10.0), "strong": (3.0, 20.0), "other": (2.0, 2.0)},
    vault={"weak": (1.0, 6.0), "strong": (1.5, 8.0), "other": (2.0, 4.0)},
)


def cells(rows, sweep):
    return {row.damage: row for row in rows if row.sweep == sweep}


def test_the_drop_is_interpolated_in_every_scene_and_then_averaged() -> None:
    found = cells(match(TWO, SWEEPS), "ours")
    assert tuple(found) == MATCHED_DAMAGES[2:]  # at less, even the weakest does more to some scene
    assert found[1.5].drop.mean == pytest.approx((12.5 + 8.0) / 2)
    assert (found[1.5].strengths, found[1.5].gentle) == (2, 0)


def test_every_scene_counts_the_same_in_the_damage_whatever_its_number_of_seeds() -> None:
    room, vault = outcomes(room={"weak": (1.0, 10.0)}), outcomes(vault={"weak": (1.4, 6.0)})
    rows = match([*(replace(o, seed=seed) for seed in range(3) for o in room), *vault], {"ours": ["weak"]})
    found = cells(rows, "ours")[2.0]
    assert (found.scene_drop, found.drop.mean) == pytest.approx((1.2, 8.0))


def test_the_largest_drop_counts_where_no_strength_reaches_the_damage() -> None:
    rows = match(TWO, SWEEPS)
    ours, theirs = cells(rows, "ours")[2.0], cells(rows, "theirs")[2.0]
    assert ours.drop.mean == pytest.approx((15.0 + 8.0) / 2)
    assert (ours.gentle, theirs.gentle) == (1, 0)
    shown = {str(row.cells[0]): row.cells[-1] for row in matched_table(rows).rows}
    assert str(shown["ours"]) == "≥ 11.50 (8.00 to 15.00) at 1.75 dB"
    assert (shown["ours"].best, shown["theirs"].best) == (True, False)


def test_a_strength_above_the_damage_has_no_number() -> None:
    rows = match(outcomes(room={"gof": (1.8, 12.0), "weak": (1.0, 1.0)}), {"ours": ["weak"]})
    assert [*cells(rows, "gof")] == [2.0]
    shown = {str(row.cells[0]): [*map(str, row.cells[-2:])] for row in matched_table(rows).rows}
    assert shown == {"GOF": ["–", "≥ 12.00 at 1.80 dB"], "ours": ["≥ 1.00 at 1.00 dB", "≥ 1.00 at 1.00 dB"]}


def test_drops_are_not_extrapolated_beyond_the_strongest_setting() -> None:
    rows = match(outcomes(room={"weak": (0.5, 9.0), "strong": (0.6, 4.0)}), {"ours": ["weak", "strong"]})
    assert [row.drop.mean for row in rows] == [9.0, 9.0, 9.0]
    assert [row.gentle for row in rows] == [1, 1, 1]


def test_a_lower_bound_has_the_damage_of_its_own_strength() -> None:
    rows = match(outcomes(room={"weak": (-0.5, 9.0), "strong": (-0.2, 4.0)}), {"ours": ["weak", "strong"]})
    assert [(row.drop.mean, row.scene_drop) for row in rows] == [(9.0, -0.5)] * len(rows)


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
    texts = {str(row.cells[0]): str(row.cells[-1]) for row in matched_table(rows).rows}
    assert texts == {"pruning": "≥ 7.00 at 0.70 dB", "noise": "≤ 3.00 at 2.60 dB"}


def test_searches_that_missed_in_both_directions_have_no_mean() -> None:
    names = {"noise": ["noise@1dB"]}
    for drops in ((0.5, 2.5), (0.5, 1.5)):
        assert not match(outcomes(a={"noise@1dB": (drops[0], 5.0)}, b={"noise@1dB": (drops[1], 20.0)}), names)
    (row,) = match(outcomes(a={"noise@1dB": (1.5, 5.0)}, b={"noise@1dB": (1.0, 20.0)}), names)
    assert str(matched_table([row]).rows[0].cells[-1]) == "≤ 12.50 (5.00 to 20.00) at 1.25 dB"


def test_the_name_of_a_variant_states_misses_that_cancel_in_the_mean() -> None:
    assert reached_name("noise@1dB", 0.5, 1.5) == "noise, 1 dB (0.50 to 1.50 dB reached)"
    assert reached_name("noise@1dB", 0.98, 1.02) == "noise, 1 dB"


def test_the_range_of_a_missed_damage_is_that_of_scenes_however_many_there_are() -> None:
    scenes = {f"s{i}": {"noise@1dB": (0.4 if i else 1.0, 5.0)} for i in range(9)}
    names = [row.cells[1].text for row in summary_table(outcomes(**scenes)).rows]
    assert "noise, 1 dB (0.40 to 1.00 dB reached)" in names
    (name,) = {row.name for row in survival(outcomes(**scenes)) if row.variant == "noise@1dB"}
    assert name == "noise, 1 dB (0.47 dB reached on average)"  # a survival table has no range of many scenes


def test_a_missed_damage_is_stated_where_the_drop_of_the_scene_is_unknown() -> None:
    """Against renders, the unattacked model has infinite PSNR; the strength holds the damage."""
    strengths = {"noise@6dB": "fraction=1, 1.13 dB reached", "crop@6dB": "fraction=0.5", "unattacked": ""}
    known = outcomes(a={name: (1.0, 5.0) for name in strengths if name != "unattacked"})
    own = [replace(o, targets={"message": o.targets["message"]}, strength=strengths[o.variant]) for o in known]
    expected = {"unattacked", "noise, 6 dB (1.13 dB reached)", "crop, 6 dB"}
    assert {row.cells[1].text for row in summary_table(own).rows} == expected
    assert {row.name for row in survival(own)} == expected
    assert {row.cells[0].text for row in model_table(own).rows} == expected
    of_three = [*own, *(replace(o, scene="b", strength=o.strength.replace("1.13", "2.50")) for o in own)]
    assert "noise, 6 dB (1.13 to 2.50 dB reached)" in {row.name for row in survival(of_three)}


def test_rows_over_fewer_scenes_than_the_table_state_their_number() -> None:
    both, one = {"x": (1.0, 5.0), "y": (1.0, 6.0)}, {"x": (1.0, 5.0)}
    found = benchmark({"a": both, "b": one, "c": one})
    tables = condition_tables(found[0].condition, survival(found), contest(found, {}), match(found, {}))
    names = {str(row.cells[0]) for table in tables for row in table.rows}
    assert "y (1 of 3 scenes)" in names
    assert "x" in names


@pytest.mark.parametrize("damage", [0.3, 1, 2.0, 1e-05, 20])
def test_a_damage_is_read_back_from_the_name_of_its_variant(damage: float) -> None:
    assert wanted_damage(variant_at("random_pruning", damage)) == damage
    assert wanted_damage("random_pruning") is None


def test_models_without_a_message_have_no_rows() -> None:
    scene_only = [
        Outcome("own", "bot", o.variant, {"scene": o.targets["scene"]}, {}, reference=o.reference) for o in TWO
    ]
    assert match(scene_only, SWEEPS) == []


def test_the_table_marks_the_largest_drop_at_each_damage_that_was_reached() -> None:
    table = matched_table(match(TWO, SWEEPS))
    assert [column.title for column in table.columns[2:]] == ["1.5 dB", "2 dB"]
    assert {str(row.cells[0]): sum(cell.best for cell in row.cells) for row in table.rows} == {"ours": 2, "theirs": 0}
    assert conditions_markdown([], [], []).startswith("No model with a message")


POINTS = st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), min_size=1, max_size=12)
SWEEP = ([0.0, 0.5, 1.0, 2.0], [0.0, 4.0, 6.0, 10.0])  # scene drop, message drop


@given(POINTS)
def test_the_front_is_what_brute_force_finds(points):
    front = [not any(x <= a and y <= b and (x, y) != (a, b) for x, y in points) for a, b in points]
    assert pareto_front(*zip(*points, strict=True)).tolist() == front


@given(POINTS, st.randoms(use_true_random=False), st.integers(0, 8))
def test_neither_order_nor_dominated_strengths_change_the_comparison(points, random, at):
    found = matched_message_drop(*zip(*points, strict=True), at)
    shuffled = random.sample(points, len(points))
    assert matched_message_drop(*zip(*shuffled, strict=True), at) == found
    worse = (max(x for x, _ in points), min(y for _, y in points))
    assert matched_message_drop(*zip(*points, worse, strict=True), at) == found


@given(POINTS, st.integers(0, 8))
def test_at_a_measured_damage_the_best_setting_up_to_it_counts(points, at):
    found = matched_message_drop(*zip(*points, strict=True), at)
    damages = [x for x, _ in points]
    if at in damages:
        best = max(y for x, y in points if x <= at)
        assert found >= best
        if (at, best) in points and all(y < best for x, y in points if x < at):
            assert found == best


@pytest.mark.parametrize(("at", "drop"), [(0.0, 0.0), (0.25, 2.0), (0.5, 4.0), (1.5, 8.0), (2.0, 10.0)])
def test_between_settings_the_drop_is_linear(at, drop):
    assert matched_message_drop(*SWEEP, at) == drop


def test_nothing_is_extrapolated():
    assert matched_message_drop(*SWEEP, 2.01) is None
    assert matched_message_drop([5.0], [20.0], 2.0) is None
