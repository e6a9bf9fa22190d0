"""Attacks compared: survival of the message, means over scenes, and GSPure against others, also at equal damage."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.evaluation.contest import MESSAGE_DROP, SCENE_DROP, SCORE, contest, leads
from gspure.evaluation.matched import MATCHED_DAMAGES, match, pareto_front, title_with_damage
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.summary import summarize
from gspure.evaluation.survival import Survival, control_levels, not_embedded, survival
from gspure.metrics.image_metrics import MARGIN, rms_ratio
from gspure.metrics.retrieval import Retrieval
from gspure.metrics.statistics import Interval
from gspure.report.attack_tables import matched_table
from tests.contest_cases import BEFORE, CONTROLS, attacked, benchmark, measured, outcome, survives

FOUR = benchmark({f"s{i}": {"gone": (2.0, 20.0), "left": (1.0, 5.0), "half": (1.0, 5.0 * i)} for i in range(4)})
NEAREST = Retrieval(1.0, 1.0, 1.0, 4, 17)
UNRELATED = Retrieval(0.25, 0.5, 0.0, 4, 17)


def by_variant(outcomes: Sequence[Outcome]) -> dict[str, Survival]:
    return {row.variant: row for row in survival(outcomes) if row.extraction == "message"}


def with_message(o: Outcome, psnr: float) -> Outcome:
    return replace(o, targets={**o.targets, "message": measured("message", psnr)})


def with_retrieval(outcomes: Sequence[Outcome], **of_variants: Retrieval) -> list[Outcome]:
    return [
        replace(o, retrieval={"message": of_variants[o.variant]}) if o.variant in of_variants else o for o in outcomes
    ]


def test_a_message_survives_where_it_stands_out_from_the_highest_control_of_its_scene() -> None:
    rows = by_variant(FOUR)
    assert [*map(survives, rows.values())] == [True, False, True, True]  # unattacked, gone, left, half
    assert rows["left"].above_floor.mean == BEFORE["message"] - 5 - CONTROLS["mean_colour"]
    assert (rows["gone"].survived, rows["left"].survived) == (0, 4)
    assert rows["gone"].above_floor.mean == -2.0


def test_the_floor_is_the_highest_control_without_the_message_in_every_scene() -> None:
    assert control_levels(FOUR) == {(f"s{i}", 0): CONTROLS["mean_colour"] for i in range(4)}
    levels = {"wrong_key": 25.0, "other_scene": 11.0}
    leaking = [outcome(name, "s0", targets={"message": level}) for name, level in levels.items()]
    higher = [o for o in FOUR if (o.scene, o.variant) != ("s0", "other_scene")] + leaking
    assert control_levels(higher) == control_levels(FOUR) | {("s0", 0): 11.0}


def test_a_message_that_is_extracted_exactly_is_present_and_survives() -> None:
    is_exact = {("s0", "unattacked"), ("s0", "left")}
    rows = by_variant([with_message(o, math.inf) if (o.scene, o.variant) in is_exact else o for o in FOUR])
    assert (rows["left"].present, rows["left"].survived, rows["gone"].survived) == (4, 4, 0)
    assert rows["left"].share_left.scenes == rows["left"].above_floor.scenes == 3


@pytest.mark.parametrize(("from_clean", "only_retrieved"), [(UNRELATED, 2), (NEAREST, 1)])
def test_retrieval_counts_only_where_a_clean_model_does_not_show_the_message(from_clean, only_retrieved) -> None:
    drops = {"x": (1.0, 25.0)}
    checked = with_retrieval(benchmark({"a": drops}), unattacked=NEAREST, x=NEAREST, clean=from_clean)
    row = by_variant([*checked, *with_retrieval(benchmark({"b": drops}), unattacked=NEAREST, x=NEAREST)])["x"]
    assert (row.present, row.survived, row.only_retrieved) == (2, 0, only_retrieved)


def test_the_share_left_is_a_ratio_of_means_over_seeds() -> None:
    floor = CONTROLS["mean_colour"]
    above = BEFORE["message"] - floor
    first = benchmark({"a": {"x": (1.0, above / 2)}})
    weak = MARGIN / 2  # of the second seed, before and after
    second = [replace(with_message(o, floor + weak) if not o.is_control else o, seed=1) for o in first]
    assert by_variant(first + second)["x"].share_left.mean == pytest.approx((above / 2 + weak) / (above + weak))


def test_a_message_that_was_not_embedded_cannot_survive() -> None:
    outcomes = [o for o in benchmark({s: {"x": (1.0, 1.0)} for s in "ab"}) if (o.scene, o.variant) != ("a", "clean")]
    row = by_variant([*outcomes, outcome("clean", "a", targets={"message": 27.5})])["x"]
    assert (row.present, row.survived, row.above_floor.scenes, survives(row)) == (1, 1, 1, True)
    assert row.message_drop.scenes == row.scene_drop.scenes == row.share_left.scenes == 1


def test_the_rms_ratio_is_one_for_equal_damage_whatever_the_level_before() -> None:
    def lowered(before: float) -> list[float]:
        return [before, -10 * math.log10(10 ** (-before / 10) + 3e-4)]

    assert rms_ratio([lowered(27.8)], [lowered(33.5)]) == pytest.approx(1.0)
    assert rms_ratio([lowered(27.8)] * 2, [lowered(33.5), lowered(20.0)]) == pytest.approx(1.0)
    assert rms_ratio([lowered(27.8)] * 2, [lowered(33.5), [30.0, 30.0]]) == pytest.approx(math.sqrt(2))
    assert rms_ratio([[20.0, 21.0]], [lowered(30.0)]) == 0.0
    assert math.isnan(rms_ratio([lowered(30.0)], [[30.0, 30.0]]))


FADED = benchmark({"a": {"gspure": (1.0, 20.0), "gof": (1.0, 21.0)}})


def above_controls(margin: float) -> list[Outcome]:
    """The outcomes of FADED, with a message that is so far above the controls before any attack."""
    level = max(CONTROLS[name] for name in ("clean", "other_scene", "black", "mean_colour")) + margin
    return [with_message(o, level) if o.variant == "unattacked" else o for o in FADED]


ALONE = outcome("unattacked", "a", targets={"message": 3.0})
FLAT = replace(ALONE, targets={"message": measured("message", 3.0, others=0.0)})
NOT_RETRIEVED = with_retrieval(FADED, unattacked=UNRELATED, gspure=UNRELATED, gof=UNRELATED)


def test_a_message_near_the_controls_not_retrieved_or_flat_is_not_embedded() -> None:
    for outcomes in (FADED, with_retrieval(FADED, unattacked=NEAREST), above_controls(MARGIN), [ALONE]):
        assert not_embedded(outcomes) == []
    for outcomes in (above_controls(MARGIN - 0.25), NOT_RETRIEVED, [FLAT]):
        assert not_embedded(outcomes) == [("sis", "a", 0)]
        assert {row.present for row in survival(outcomes)} == {0}


REACHED = Interval(1.1, 0.9, 1.3, 0.95, 9)


@pytest.mark.parametrize(
    ("scene_drop", "suffix"),
    [
        (REACHED, " (1.10 dB reached on average)"),
        (REACHED._replace(level=0.75), " (0.90 to 1.30 dB reached)"),
        (Interval(1.0, 0.98, 1.02, 0.95, 9), ""),
        (Interval(1.0, 0.98, 1.02, 0.75, 3), ""),
        (Interval(0.5, 0.5, 0.5, 0.0, 1), " (0.50 dB reached)"),
        (None, ""),
    ],
)
def test_the_name_of_a_variant_has_the_damage_where_the_search_missed_it(scene_drop, suffix) -> None:
    row = survival(benchmark({"a": {"gof@1dB": (1.0, 5.0)}}))[1]
    assert row._replace(scene_drop=scene_drop).name == f"GOF, 1 dB{suffix}"
    assert row._replace(scene_drop=Interval(1.0, 1.0, 1.0, 0.0, 1), damage=scene_drop).name == f"GOF, 1 dB{suffix}"


def test_the_rms_ratio_of_a_variant_is_that_of_its_levels() -> None:
    row = survival(benchmark({"a": {"gof": (1.0, 10.0)}}))[1]
    assert row.rms_ratio == pytest.approx(rms_ratio([[28.0, 18.0]], [[30.0, 29.0]]))


def test_rows_are_means_over_scenes_in_the_order_of_outcomes() -> None:
    def of_scheme(scheme: str, variant: str, scenes: int, scene: float, message: float) -> list[Outcome]:
        levels = [{"scene": scene, "message": message + i} for i in range(scenes)]
        return [outcome(variant, f"s{i}", scheme=scheme, targets=level) for i, level in enumerate(levels)]

    mine = of_scheme("my_scheme", "gspure", 3, 29.0, 10.0) + of_scheme("my_scheme", "wrong_key", 3, 30.0, 8.0)
    rows = summarize([*mine, *of_scheme("splats_in_splats", "gspure", 7, 28.0, 10.0)])
    assert [(row.condition.scheme, row.variant, row.message.mean, row.message.scenes) for row in rows] == [
        ("my_scheme", "gspure", 11.0, 3),
        ("my_scheme", "wrong_key", 9.0, 3),
        ("splats_in_splats", "gspure", 13.0, 7),
    ]
    assert rows[0].score.mean == (BEFORE["message"] - 11) - (BEFORE["scene"] - 29)
    assert rows[1].score is None
    assert math.isnan(rows[0].paper_score)  # only the paper's schemes have one
    assert rows[2].paper_score == 15.21


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


def test_a_rival_of_half_the_scenes_competes() -> None:
    scenes = {"a": {"gspure@1dB": (1.0, 10.0), "gof@1dB": (1.0, 7.0)}, "b": {"gspure@1dB": (1.0, 10.0)}}
    (row,) = leads(benchmark(scenes), {"gspure": ["gspure@1dB"], "crop": ["gof@1dB"]})
    assert (row.attack, row.difference.mean, row.difference.scenes, row.is_bound) == ("crop", 3.0, 1, False)


def test_the_unattacked_model_and_controls_are_no_rivals() -> None:
    attacks = {name: [name] for name in ("gspure", "unattacked", "clean")}
    assert leads(benchmark({"a": {"gspure": (1.0, 10.0)}}), attacks) == []


@pytest.mark.parametrize(
    ("drops", "suffix"),
    [((1.02, 0.98), ""), ((1.0, 2.0, 0.5), " (0.50 to 2.00 dB reached)"), ((0.5, math.inf), " (0.50 dB reached)")],
)
def test_a_title_has_the_range_of_damages_where_any_misses_the_wanted(drops, suffix) -> None:
    assert title_with_damage("GOF", 1.0, *drops) == f"GOF{suffix}"
    assert title_with_damage("GOF", 1.0) == title_with_damage("GOF", math.nan, *drops) == "GOF"


SWEEPS = {"ours": ["weak", "strong"], "theirs": ["other", "absent"]}


TWO = benchmark(
    {
        "room": {"weak": (1.0, 10.0), "strong": (3.0, 20.0), "other": (2.0, 2.0)},
        "vault": {"weak": (1.0, 6.0), "strong": (1.5, 8.0), "other": (2.0, 4.0)},
    }
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
    rows = match(benchmark({"room": drops}), AIMED)
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
