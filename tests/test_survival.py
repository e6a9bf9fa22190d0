"""Survival of the message against the floor of the same scene, and means over scenes."""

import math
from dataclasses import replace

import pytest

from gspure.evaluation.summary import summarize
from gspure.evaluation.survival import control_levels, not_embedded, survival
from gspure.metrics.image_metrics import MARGIN, rms_ratio
from gspure.metrics.retrieval import Retrieval
from tests.contest_cases import BEFORE, CONTROLS, benchmark, measured, outcome, survives

FOUR = benchmark({f"s{i}": {"gone": (2.0, 20.0), "left": (1.0, 5.0), "half": (1.0, 5.0 * i)} for i in range(4)})


def by_variant(outcomes, extraction="message"):
    return {row.variant: row for row in survival(outcomes) if row.extraction == extraction}


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
    exact = [
        replace(o, targets={**o.targets, "message": measured("message", math.inf)})
        if (o.scene, o.variant) in {("s0", "unattacked"), ("s0", "left")}
        else o
        for o in FOUR
    ]
    rows = by_variant(exact)
    assert (rows["left"].present, rows["left"].survived, rows["gone"].survived) == (4, 4, 0)
    assert rows["left"].share_left.scenes == rows["left"].above_floor.scenes == 3


@pytest.mark.parametrize("from_clean", [0.0, 1.0])
def test_retrieval_counts_only_where_a_clean_model_does_not_show_the_message(from_clean) -> None:
    outcomes = benchmark({scene: {"x": (1.0, 25.0)} for scene in "ab"})
    top1 = {("a", "clean"): from_clean}
    judged = [
        replace(o, retrieval={"message": Retrieval(top1.get((o.scene, o.variant), 1.0), 0.5, 0.5, 3, 20)})
        if (o.scene, o.variant) in top1 or not o.is_control
        else o
        for o in outcomes
    ]
    row = by_variant(judged)["x"]
    assert (row.present, row.survived, row.only_retrieved) == (2, 0, 1 if from_clean else 2)


def test_the_share_left_is_a_ratio_of_means_over_seeds() -> None:
    above = BEFORE["message"] - CONTROLS["mean_colour"]
    first = benchmark({"a": {"x": (1.0, above / 2)}})
    weak = MARGIN / 2  # of the second seed, before and after
    second = [
        replace(o, seed=1, targets=o.targets | {"message": measured("message", CONTROLS["mean_colour"] + weak)})
        if o.variant in ("unattacked", "x")
        else replace(o, seed=1)
        for o in first
    ]
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


NEAREST = Retrieval(1.0, 1.0, 1.0, 4, 17)
UNRELATED = Retrieval(0.25, 0.5, 0.0, 4, 17)


def with_retrieval(outcomes, **of_variants: Retrieval):
    return [
        replace(o, retrieval={"message": of_variants[o.variant]}) if o.variant in of_variants else o for o in outcomes
    ]


FADED = benchmark({"a": {"gspure": (1.0, 20.0), "gof": (1.0, 21.0)}})


def test_a_message_that_is_not_retrieved_before_any_attack_is_not_embedded() -> None:
    assert not_embedded(FADED) == not_embedded(with_retrieval(FADED, unattacked=NEAREST)) == []
    outcomes = with_retrieval(FADED, unattacked=UNRELATED, gspure=UNRELATED, gof=UNRELATED)
    assert not_embedded(outcomes) == [("sis", "a", 0)]
    assert {row.present for row in survival(outcomes)} == {0}


def of_scheme(scheme, place, variant, **psnr):
    return outcome(variant, place, scheme=scheme, targets=psnr)


@pytest.fixture
def outcomes():
    """Three scenes of one scheme, seven of another."""
    few = [of_scheme("my_scheme", f"s{i}", "gspure", scene=29.0, message=10.0 + i) for i in range(3)]
    controls = [of_scheme("my_scheme", f"s{i}", "wrong_key", scene=30.0, message=8.0) for i in range(3)]
    many = [of_scheme("splats_in_splats", f"s{i}", "gspure", scene=28.0, message=10.0 + i) for i in range(7)]
    return [*few, *controls, *many]


def test_rows_are_means_over_scenes_in_the_order_of_outcomes(outcomes):
    rows = summarize(outcomes)
    assert [row.condition.scheme for row in rows] == ["my_scheme", "my_scheme", "splats_in_splats"]
    assert [row.variant for row in rows] == ["gspure", "wrong_key", "gspure"]
    assert [row.message.mean for row in rows] == [11.0, 8.0, 13.0]
    assert [row.message.scenes for row in rows] == [3, 3, 7]
    assert rows[0].score.mean == (BEFORE["message"] - 11) - (BEFORE["scene"] - 29)


def test_a_control_has_no_score_and_only_the_papers_schemes_have_the_papers(outcomes):
    ours, control, theirs = summarize(outcomes)
    assert control.score is None
    assert math.isnan(ours.paper_score)
    assert theirs.paper_score == 15.21
