"""The owner's audit: every sentence follows from the tables, and none says more than few scenes allow."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.cli import main
from gspure.evaluation.comparison import RENDER, ViewMetrics
from gspure.evaluation.contest import contest
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.statistics import Interval
from gspure.evaluation.survival import survival
from gspure.evaluation.tables import write_table
from gspure.figures.audit import audit
from gspure.figures.wording import db, how_sure, listed, loses
from tests.contest_cases import attacked, benchmark, outcome
from tests.test_report import Page


def told(outcomes, sweeps=None):
    """Return the verdict and the points by label of the one scheme."""
    (found,) = audit(outcomes, survival(outcomes), contest(outcomes, sweeps or {}))
    assert len(dict(found.points)) == len(found.points)
    return found.verdict, dict(found.points)


def of_scenes(count, **drops):
    return benchmark({f"s{i}": drops for i in range(count)})


def test_what_survives_is_told_with_what_it_costs_message_and_scene() -> None:
    verdict, points = told(of_scenes(2, gspure=(0.5, 20.0), gof=(3.0, 4.0), noise=(0.1, 0.2)))
    assert verdict == "Of 3 attacks, the message survives 2 in every scene and 1 in none."
    assert points["It survives"] == "Noise (message −0.2, scene −0.1 dB); and GOF (message −4.0, scene −3.0 dB)."
    assert points["It is gone after"] == "GSPure (message −20.0, scene −0.5 dB)."
    assert points["Before any attack"] == "The message lies 18.0 dB (18.0 to 18.0) above the highest control."
    assert (
        points["The key"] == "A wrong one shows 21.0 dB (21.0 to 21.0) less than the right one, and nothing that "
        "stands out from the controls."
    )


def test_a_message_that_is_seen_without_the_key_is_told() -> None:
    outcomes = [o for o in of_scenes(2, gspure=(0.5, 20.0)) if o.variant != "wrong_key"]
    outcomes += [outcome("wrong_key", f"s{i}", targets={"message": 25.0}) for i in range(2)]
    assert told(outcomes)[1]["The key"].endswith("some of the message is seen without the key.")


def test_where_the_message_survives_in_some_scenes_they_are_counted() -> None:
    verdict, points = told(benchmark({"a": {"x": (1.0, 2.0)}, "b": {"x": (1.0, 25.0)}}))
    assert verdict == "Of 1 attack, the message survives 0 in every scene and 1 in some only."
    assert points["It survives in some scenes"] == "X (message −13.5, scene −1.0 dB; 1 of 2)."


def test_what_gspure_takes_from_beside_the_path_stands_beside_what_it_takes_on_it() -> None:
    def beside(o):
        return {name: mean._replace(psnr=mean.psnr - 3) for name, mean in o.targets.items()}

    outcomes = of_scenes(2, gspure=(0.5, 20.0))
    assert "Beside the cameras' path" not in told(outcomes)[1]
    before = dict(outcomes[0].reference)
    seen = [replace(o, off_path=beside(o), off_path_reference=before) for o in outcomes]
    said = told(seen)[1]["Beside the cameras' path"]
    assert said.startswith("After GSPure the message loses 23.0 dB (23.0 to 23.0) there (on it loses 20.0 dB")
    assert "the scene loses 3.5 dB (3.5 to 3.5) there (on it loses 0.5 dB" in said


def test_a_message_that_was_not_there_cannot_be_lost() -> None:
    missing = [o for o in of_scenes(2, gspure=(0.5, 3.0)) if o.variant != "clean"]
    missing += [outcome("clean", f"s{i}", targets={"message": 27.5}) for i in range(2)]
    verdict, points = told(missing)
    assert verdict.startswith("There is no message to lose")
    assert "It stands out in 0 of 2 scenes, and only there can it survive." in points["Before any attack"]
    assert not any(label.startswith("It ") for label in points)


def test_without_the_unattacked_model_nothing_is_judged() -> None:
    outcomes = [o for o in of_scenes(2, gspure=(0.5, 20.0)) if o.variant != "watermarked"]
    outcomes.append(outcome("watermarked", "s0", failure="gspure extract: out of memory"))
    verdict, points = told(outcomes)
    assert verdict.startswith("What the message was before any attack is not known")
    assert points["Not possible"].startswith("Watermarked on 1 of 2 models")


def test_scenes_without_the_message_are_left_out_of_the_verdict() -> None:
    outcomes = of_scenes(2, gspure=(0.5, 3.0))
    outcomes[outcomes.index(next(o for o in outcomes if o.variant == "clean"))] = outcome(
        "clean", "s0", targets={"message": 27.5}
    )
    assert told(outcomes)[0] == "The message survives all of 1 attack, in every scene in which it is there at all."


def test_a_loss_like_that_of_random_pruning_is_no_reliable_effect() -> None:
    drops = {f"s{i}": {"gspure": (0.5, 3.0 + i), "random_matched": (0.5, 4.0)} for i in range(3)}
    assert told(benchmark(drops))[1]["Against chance"].startswith(
        "No reliable effect. From the message it takes 0.0 dB (−1.0 to 1.0) more than removing as much at random"
    )
    less = told(of_scenes(3, gspure=(0.5, 3.0), random_matched=(2.5, 4.0)))[1]["Against chance"]
    assert less.startswith("No effect of its own. From the message it takes 1.0 dB (1.0 to 1.0) less")
    assert less.endswith("from the scene 2.0 dB (2.0 to 2.0) less.")
    more = told(of_scenes(3, gspure=(0.5, 9.0), random_matched=(0.5, 4.0)))[1]["Against chance"]
    assert more.startswith(
        "From the message it takes 5.0 dB (5.0 to 5.0) more than removing as much at random, in every"
    )


def test_one_scene_is_never_reliable() -> None:
    text = told(of_scenes(1, gspure=(0.5, 9.0), random_matched=(0.5, 4.0)))[1]["Against chance"]
    assert text.startswith("No reliable effect. From the message it takes 5.0 dB more")
    assert "in the one scene" in text


def test_who_is_better_than_gspure_is_named_with_by_how_much() -> None:
    drops = {f"s{i}": {"gspure": (0.5, 9.0), "plain": (0.5, 8.0 + 2 * i), "twin": (0.5, 9.0)} for i in range(3)}
    text = told(benchmark(drops))[1]["Is GSPure the best?"]
    assert text == (
        "By Score, none does better everywhere. Better on average, not in every scene: plain. As good on average, to "
        "0.05 dB: twin."
    )
    drops = {f"s{i}": {"gspure": (0.5, 9.0), "plain": (0.5, 10.0 + 2 * i)} for i in range(3)}
    text = told(benchmark(drops))[1]["Is GSPure the best?"]
    assert text == "By Score, no. Better in every scene: plain by 3.0 dB (1.0 to 5.0)."
    best = told(of_scenes(3, gspure=(0.5, 9.0), gof=(0.5, 4.0)))[1]["Is GSPure the best?"]
    assert best == "By Score, none of 1 rival does better on average."


@pytest.mark.parametrize(
    ("scenes", "said"),
    [
        (4, "With 4 scenes and 1 rival, no difference in Score can be significant: corrected, p is 0.12 at best."),
        (8, "Differences in Score that are significant at 5%: GOF (p = 0.0078)."),
    ],
)
def test_it_says_whether_any_difference_can_be_significant(scenes: int, said: str) -> None:
    assert said in told(of_scenes(scenes, gspure=(0.5, 9.0), gof=(0.5, 4.0)))[1]["How sure"]


def test_scenes_and_seeds_are_counted() -> None:
    outcomes = benchmark({"a": {"gspure": (0.5, 9.0)}, "b": {"gspure": (0.5, 9.0)}}, seeds=3)
    assert told(outcomes)[1]["How sure"] == "2 scenes, 3 seeds each."
    fewer = [o for o in outcomes if (o.scene, o.seed) != ("a", 2)]
    assert told(fewer)[1]["How sure"] == "2 scenes, 2 to 3 seeds each."


def test_attacks_that_did_not_touch_the_message_are_no_evidence() -> None:
    outcomes = of_scenes(2, gspure=(0.5, 20.0))
    outcomes += [attacked("noise", 1.0, 0.0, f"s{i}", reached={"message": False}) for i in range(2)]
    verdict, points = told(outcomes)
    assert verdict == "The message survives none of 1 attack, in any scene."
    assert points["Did not touch it"].startswith("Noise did not change anything that the extraction reads.")


def test_failures_are_told_with_their_reason_and_where() -> None:
    outcomes = [*of_scenes(2, gspure=(0.5, 20.0)), outcome("gof", "s0", failure="gspure attack: out of memory")]
    assert told(outcomes)[1]["Not possible"] == "GOF on 1 of 2 models: gspure attack: out of memory"
    everything = [outcome(name, failure="no PyTorch") for name in ("watermarked", "gspure")]
    verdict, points = told(everything)
    assert verdict == "Nothing could be measured: everything failed."
    assert points["Not possible"] == "Watermarked and GSPure on 1 of 1 model: no PyTorch"


def test_without_key_the_scene_alone_is_told() -> None:
    views = [ViewMetrics("scene", "mean", psnr, 0.9, RENDER) for psnr in (math.inf, 35.52, 30.0)]
    outcomes = [
        Outcome("vanilla", "chair", name, {"scene": view}, {"scene": 3})
        for name, view in zip(("watermarked", "gspure", "gof"), views, strict=True)
    ]
    verdict, points = told(outcomes)
    assert verdict == "Whether a message survives was not measured: that takes the owner's key."
    assert points["The scene"] == (
        "PSNR after each attack against what the unattacked model shows: GSPure 35.5 dB and GOF 30.0 dB."
    )


def test_without_controls_losses_are_told_and_nothing_is_judged() -> None:
    verdict, points = told([o for o in of_scenes(2, gspure=(0.5, 20.0)) if not o.is_control])
    assert verdict.startswith("Whether what is left is still a message was not judged")
    assert points["All attacks"] == "GSPure (message −20.0, scene −0.5 dB)."


def test_at_equal_damage_the_strongest_attack_is_named() -> None:
    outcomes = of_scenes(2, gspure=(1.0, 10.0), weak=(1.0, 12.0), strong=(4.0, 12.0))
    text = told(outcomes, {"theirs": ["weak", "strong"]})[1]["At equal damage"]
    assert text.startswith("For 0.3 dB of the scene theirs takes 0.6 dB (0.6 to 0.6) more, in every scene.")
    weak = told(of_scenes(2, gspure=(1.0, 10.0), weak=(1.0, 9.0)), {"weak": ["weak"]})[1]["At equal damage"]
    assert weak == "For 0.3 to 2 dB of the scene none takes more everywhere."


DROPS = st.tuples(st.floats(-1, 5), st.floats(-1, 25))


@settings(max_examples=20, deadline=None)
@given(
    st.dictionaries(
        st.sampled_from("abc"), st.fixed_dictionaries({"gspure": DROPS, "x": DROPS, "y": DROPS}), min_size=1
    ),
    st.randoms(use_true_random=False),
)
def test_no_order_of_outcomes_changes_the_verdict_and_no_number_is_unknown(drops, random) -> None:
    outcomes = benchmark(drops)
    verdict, points = told(outcomes)
    assert told(random.sample(outcomes, len(outcomes)))[0] == verdict
    assert not any("nan" in text.split() or "?" in text for text in points.values())


def test_phrases_round_to_tenths_and_turn_gains_around() -> None:
    drop = Interval(-0.26, -1.0, 0.5, 0.5, 2)
    assert loses(drop) == "gains 0.3 dB (−0.5 to 1.0)"
    assert db(drop._replace(mean=-0.04)) == "0.0 dB (−1.0 to 0.5)"
    assert how_sure(Interval(1.0, 0.5, 1.5, 0.95, 6)) == "reliably"
    assert listed(f"n{i}" for i in range(15)).endswith("n11 and 3 more")


def test_the_page_opens_with_it_and_names_the_files(tmp_path: Path) -> None:
    write_table(tmp_path / "results.csv", of_scenes(2, gspure=(0.5, 20.0), gof=(3.0, 4.0)))
    made = ["--out", "contest.csv", "--survival", "survival.csv", "--markdown", "contest.md"]
    words = [word if word.startswith("--") else str(tmp_path / word) for word in ["--table", "results.csv", *made]]
    assert main(["contest", *words]) == 0
    given_files = [
        "--table",
        "results.csv",
        "--contest",
        "contest.csv",
        "--survival",
        "survival.csv",
        "--out",
        "r.html",
    ]
    words = [word if word.startswith("--") else str(tmp_path / word) for word in given_files]
    assert main(["report", *words]) == 0
    text = Page(tmp_path / "r.html").text
    assert text.index("Of 2 attacks, the message survives 1") < text.index("What this does not say")
    assert text.index("What this does not say") < text.index("What is left of the message")
    for name in ("results.csv", "survival.csv", "contest.csv"):
        assert str(tmp_path / name) in text
    assert "nan" not in text.lower()
