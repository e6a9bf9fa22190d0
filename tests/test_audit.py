"""The owner's audit: its facts follow from the tables, and its sentences do not contradict each other."""

import html
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.artifacts import known_digest, write_record
from gspure.cli import main
from gspure.evaluation.comparison import RENDER
from gspure.evaluation.contest import contest
from gspure.evaluation.controls import MESSAGE_FREE
from gspure.evaluation.detection import Detection
from gspure.evaluation.intervals import Interval
from gspure.evaluation.names import display_name
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.results import write_results
from gspure.evaluation.survival import MARGIN, survival
from gspure.report.audit import ALLOWED, EQUAL, SIGNIFICANT, Audit, audits
from gspure.report.templates import cost, db, listed, render, say, size
from tests.contest_cases import BEFORE, attacked, benchmark, measured, outcome
from tests.test_report import Page


def audit_of(outcomes, sweeps=None) -> Audit:
    (audit,) = audits(outcomes, survival(outcomes), contest(outcomes, sweeps or {}))
    return audit


def told(outcomes, sweeps=None) -> tuple[str, dict[str, str]]:
    """Return the verdict and the sentences by label."""
    known = {"margin": MARGIN, "significant": SIGNIFICANT, "equal": EQUAL}
    text = render("audit.html.j2", audits=[audit_of(outcomes, sweeps)], **known)
    plain = html.unescape(" ".join(text.split()))
    points = re.findall(r"<li><b>(.*?)</b> <span>(.*?)</span></li>", plain)
    assert len(dict(points)) == len(points)
    return re.search(r"<p><b>(.*?)</b></p>", plain)[1], dict(points)


def of_scenes(count, **drops):
    return benchmark({f"s{i}": drops for i in range(count)})


def named(rows) -> list[str]:
    return [row.variant for row in rows]


def sentence(outcomes) -> str:
    return " ".join(say("verdict.html.j2", "answer", audit_of(outcomes), ALLOWED).split())


def test_the_verdict_is_about_the_strongest_attack_within_the_allowed_damage() -> None:
    lost = of_scenes(2, gspure=(0.5, 20.0), gof=(1.9, 20.5), harsh=(2.5, 25.0))
    assert audit_of(lost).strongest.variant == "gof"
    assert sentence(lost).startswith("The message did not survive GOF, which lowers the PSNR of the message by 20.5 dB")
    kept = of_scenes(2, gspure=(0.5, 2.0), gof=(1.9, 1.0), harsh=(2.5, 25.0))
    assert sentence(kept).startswith("The message survived every tested attack that lowers")
    assert "The strongest, GSPure," in sentence(kept)
    harsh = of_scenes(2, harsh=(2.5, 25.0))
    assert audit_of(harsh).strongest is None
    assert sentence(harsh).startswith("The message survived no attack")


def detected(variant: str, scene: str = "s0", **present: bool) -> Outcome:
    detections = {name: Detection(50.0, 1.0, 0.0, 0.0, is_there, 9, 16) for name, is_there in present.items()}
    return replace(outcome(variant, targets={"scene": 30.0}), scene=scene, reference={}, detections=detections)


def test_of_several_detectors_one_that_finds_the_mark_is_judged_and_attacks_are_listed_once() -> None:
    audit = audit_of([detected(name, alpha=False, zeta=True) for name in ("unattacked", "gspure")])
    assert (audit.extraction, audit.verdict) == ("zeta", "judged")
    assert [row.variant for row in audit.scene_psnr] == ["gspure"]
    audit = audit_of([detected(name, alpha=True, bits=False) for name in ("unattacked", "gspure")])
    assert audit.extraction == "bits"


def test_a_mark_that_was_not_detected_before_the_attacks_is_said_not_to_be_judged() -> None:
    points = told([detected(name, alpha=False, zeta=True) for name in ("unattacked", "gspure")])[1]
    assert points["Mark (alpha)"].startswith(
        "Survival cannot be judged: before any attack, the mark (alpha) is not present"
    )
    points = told([detected(name, alpha=True, zeta=True) for name in ("unattacked", "gspure")])[1]
    assert "cannot be judged" not in points["Mark (zeta)"]


def test_the_audit_tells_where_the_clean_model_shows_the_mark_too() -> None:
    found = [detected(name, scene, mark=True) for scene in "ab" for name in ("unattacked", "gspure")]
    points = told([*found, detected("clean", "a", mark=True), detected("clean", "b", mark=False)])[1]
    assert "present in 1 of 2 scenes; in 1, the clean model shows it, too; only scenes" in points["Before any attack"]


def test_an_attack_that_the_message_survives_in_fewer_scenes_is_the_stronger() -> None:
    mixed = benchmark({"a": {"gof": (1.0, 20.0), "noise": (1.0, 39.0)}, "b": {"gof": (1.0, 20.0), "noise": (1.0, 2.0)}})
    assert audit_of(mixed).strongest.variant == "gof"
    only = benchmark({"a": {"noise": (1.0, 39.0)}, "b": {"noise": (1.0, 2.0)}})
    assert sentence(only).startswith("The message did not survive noise in 1 of 2 scenes. The attack lowers")


def test_an_attack_names_the_scenes_in_which_only_retrieval_identifies_the_message_unless_all() -> None:
    row = next(row for row in survival(of_scenes(2, gof=(0.5, 20.0))) if row.variant == "gof")
    assert "scenes" not in cost(row._replace(survived=0, only_retrieved=2))
    assert cost(row._replace(survived=0, only_retrieved=1)).endswith("; 1 of 2 scenes)")


@pytest.mark.parametrize(("damage", "strongest"), [(1.97, "gof@2dB"), (2.04, "gof@2dB"), (2.06, "gspure")])
def test_a_strength_that_was_searched_for_the_allowed_damage_counts_if_the_search_did_not_miss_it(
    damage: float, strongest: str
) -> None:
    lost = of_scenes(1, **{"gspure": (0.5, 2.0), "gof@2dB": (damage, 20.0)})
    assert audit_of(lost).strongest.variant == strongest
    assert ("survived every tested attack" in sentence(lost)) == (strongest == "gspure")


def test_an_attack_that_the_message_survives_in_fewer_scenes_is_stronger_even_if_retrieval_identifies_the_rest() -> (
    None
):
    audit = audit_of(of_scenes(2, gspure=(1.0, 5.0), gof=(1.0, 6.0)))
    left = {"gspure": {"survived": 1, "only_retrieved": 1}}
    faded = replace(audit, attacks=[row._replace(**left.get(row.variant, {})) for row in audit.attacks])
    assert (audit.strongest.variant, faded.strongest.variant) == ("gof", "gspure")
    told_of = " ".join(say("verdict.html.j2", "answer", faded, ALLOWED).split())
    assert told_of.startswith("The message did not survive GSPure in 1 of 2 scenes, but retrieval still identifies it")


@settings(max_examples=200, deadline=None)
@given(
    st.dictionaries(
        st.sampled_from(["gspure", "gof", "crop"]),
        st.tuples(
            st.sampled_from([0.5, 2.0, 2.03, 2.2]),
            st.sampled_from([1.0, 5.0, 20.0]),
            st.sampled_from([(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (2, 0)]),  # survived, only retrieved
        ),
        min_size=1,
    )
)
def test_the_answer_agrees_with_every_row_of_the_table(rows) -> None:
    audit = audit_of(of_scenes(2, **{name: row[:2] for name, row in rows.items()}))
    attacks = [r._replace(survived=rows[r.variant][2][0], only_retrieved=rows[r.variant][2][1]) for r in audit.attacks]
    answer = " ".join(say("verdict.html.j2", "answer", replace(audit, attacks=attacks), ALLOWED).split())
    allowed = {display_name(name): outcome for name, (damage, _, outcome) in rows.items() if damage < 2.1}
    lost = {name: survived + retrieved for name, (survived, retrieved) in allowed.items() if survived < 2}
    assert ("survived every tested attack" in answer) == bool(allowed and not lost)
    if lost:
        name = re.search(r"did not survive (\w+)", answer)[1]
        assert lost[name] == min(lost.values())
        assert (f"did not survive {name} in 1 of 2 scenes" in answer) == (allowed[name][0] == 1)


def test_attacks_that_lower_the_message_as_much_as_the_strongest_are_named() -> None:
    audit = audit_of(of_scenes(2, gspure=(1.0, 20.04), gof=(1.5, 20.0), noise=(1.0, 19.9), harsh=(2.5, 20.04)))
    assert (audit.strongest.variant, named(audit.as_strong)) == ("gspure", ["gof"])
    assert audit_of(of_scenes(2, harsh=(2.5, 20.0))).as_strong == []


@pytest.mark.parametrize(("drop", "strongest"), [(2.0, "weak"), (25.0, "other")])
def test_an_attack_that_was_measured_in_fewer_scenes_counts_only_if_the_message_did_not_survive_it(
    drop: float, strongest: str
) -> None:
    weak, other = {"weak": (1.0, 3.0)}, {"weak": (1.0, 3.0), "other": (1.0, drop)}
    found = benchmark({"a": other, "b": weak, "c": weak})
    audit = audit_of(found)
    assert (named(audit.attacks), named(audit.incomplete)) == (["weak"], ["other"])
    assert audit.strongest.variant == strongest
    verdict, points = told(found)
    (listed_apart,) = [text for label, text in points.items() if "fewer scenes" in label]
    assert listed_apart.startswith("other (1 of 3 scenes).")
    assert ("Other was measured in only 1 of 3 scenes: the message did not survive it." in verdict) == (drop == 25.0)
    assert ("did not survive other (measured in only 1 of 3 scenes)" in sentence(found)) == (drop == 25.0)


def test_attacks_that_miss_a_seed_are_named_with_the_number_of_models_they_were_measured_on() -> None:
    whole = benchmark({"a": {"weak": (1.0, 3.0), "gspure": (1.0, 20.0)}, "b": {"weak": (1.0, 3.0)}}, seeds=2)
    cut = [o for o in whole if (o.variant, o.scene, o.seed) != ("weak", "a", 1)]
    no_control = [o for o in whole if (o.variant, o.seed) != ("clean", 1)]
    label = "Measured with fewer seeds"
    assert told(cut)[1][label] == "weak (on 3 of 4 models)."
    assert label not in told(whole)[1]  # GSPure lacks a whole scene, which is said elsewhere
    assert label not in told(no_control)[1]


def test_survival_of_a_picture_whose_key_was_tried_on_no_model_without_it_is_qualified() -> None:
    found = of_scenes(3, gspure=(0.5, 2.0))
    bare = [o for o in found if o.variant not in MESSAGE_FREE]
    some = [o for o in found if o.variant not in MESSAGE_FREE or o.scene != found[0].scene]
    for outcomes, where in ((found, None), (bare, "message. A key"), (some, "message in 1 of 3 scenes. A key")):
        for text in (told(outcomes)[0], sentence(outcomes)):
            assert ("was not tried on any model" in text) == bool(where)
            assert (where or "") in text


def test_attacks_are_sorted_by_damage_and_split_by_survival() -> None:
    outcomes = of_scenes(2, gspure=(0.5, 20.0), gof=(3.0, 4.0), noise=(0.1, 0.2))
    audit = audit_of(outcomes)
    assert (named(audit.where(True)), named(audit.where(None)), named(audit.where(False))) == (
        ["noise", "gof"],
        [],
        ["gspure"],
    )
    verdict, points = told(outcomes)
    assert "survived 2 of 3 attacks" in verdict
    assert points["Survived"].startswith("Noise (message −0.2 dB, scene −0.1 dB)")
    assert "18.0 dB (18.0 to 18.0) above the floor" in points["Before any attack"]


@pytest.mark.parametrize(
    ("drops", "verdict"),
    [
        ({"a": (1.0, 2.0), "b": (1.0, 3.0)}, "all 2 attacks"),
        ({"a": (1.0, 20.0), "b": (1.0, 25.0)}, "none of 2 attacks"),
        ({"a": (1.0, 2.0), "b": (1.0, 25.0)}, "1 of 2 attacks"),
    ],
)
def test_with_one_scene_the_verdict_counts_attacks_alone(drops, verdict: str) -> None:
    text = told(of_scenes(1, **drops))[0]
    assert text == f"The message survived {verdict}."


def test_a_message_that_a_wrong_key_extracts_leaks() -> None:
    outcomes = [o for o in of_scenes(2, gspure=(0.5, 20.0)) if o.variant != "wrong_key"]
    assert "leak" not in "".join(told(outcomes)[1])
    leaking = outcomes + [outcome("wrong_key", f"s{i}", targets={"message": 25.0}) for i in range(2)]
    assert "part of the message shows" in told(leaking)[1]["With a wrong key"]
    secret = outcomes + [outcome("wrong_key", f"s{i}", targets={"message": 9.0}) for i in range(2)]
    assert "does not stand out" in told(secret)[1]["With a wrong key"]


def test_sentences_are_about_the_scenes_in_which_the_message_was_present() -> None:
    found = [o for o in benchmark({s: {"gspure": (1.0, 20.0)} for s in "ab"}) if (o.scene, o.variant) != ("a", "clean")]
    verdict, points = told([*found, outcome("clean", "a", targets={"message": 27.5})])
    assert "scene" not in verdict
    assert "present in 1 of 2 scenes" in points["Before any attack"]
    assert "to" not in points["GSPure"].split()  # of one scene: no range


def test_a_wrong_key_that_extracts_more_is_called_higher() -> None:
    found = [o for o in benchmark({"a": {"x": (1.0, 5.0)}}) if o.variant != "wrong_key"]
    points = told([*found, outcome("wrong_key", "a", targets={"message": BEFORE["message"] + 2})])[1]
    assert "2.0 dB higher" in points["With a wrong key"]


def test_scenes_in_which_the_message_survives_are_counted() -> None:
    outcomes = benchmark({"a": {"x": (1.0, 2.0)}, "b": {"x": (1.0, 25.0)}})
    assert named(audit_of(outcomes).where(None)) == ["x"]
    assert "1 of 2 scenes" in told(outcomes)[1]["Survived in some scenes"]


def test_drops_off_the_camera_path_stand_beside_those_on_it() -> None:
    def off(o):
        lower = {name: {**mean.values, "psnr": mean.psnr - 3} for name, mean in o.targets.items()}
        return {name: o.targets[name]._replace(values=values) for name, values in lower.items()}

    outcomes = of_scenes(2, gspure=(0.5, 20.0))
    assert audit_of(outcomes).off_path is None
    before = dict(outcomes[0].reference)
    drops = audit_of([replace(o, off_path=off(o), off_path_reference=before) for o in outcomes]).off_path
    assert [drop.mean for drop in drops] == [23.0, 3.5, 20.0, 0.5]


def test_a_message_that_was_not_present_cannot_be_lost() -> None:
    missing = [o for o in of_scenes(2, gspure=(0.5, 3.0)) if o.variant != "clean"]
    missing += [outcome("clean", f"s{i}", targets={"message": 27.5}) for i in range(2)]
    assert audit_of(missing).verdict == "not present"
    _, points = told(missing)
    assert "present in 0 of 2 scenes" in points["Before any attack"]
    assert "mean drops" not in points["Before any attack"]  # they are over all scenes
    assert not any("urvive" in label for label in points)


def test_without_the_unattacked_model_nothing_is_judged() -> None:
    outcomes = [o for o in of_scenes(2, gspure=(0.5, 20.0)) if o.variant != "unattacked"]
    outcomes.append(outcome("unattacked", "s0", failure="gspure extract: out of memory"))
    assert audit_of(outcomes).verdict == "no reference"
    assert told(outcomes)[1]["Failed"].startswith("Unattacked, on 1 of 2 models")


def test_scenes_without_the_message_are_left_out_of_the_verdict() -> None:
    outcomes = [o for o in of_scenes(2, gspure=(0.5, 3.0)) if (o.scene, o.variant) != ("s0", "clean")]
    outcomes.append(outcome("clean", "s0", targets={"message": 27.5}))
    audit = audit_of(outcomes)
    assert (audit.gspure.survived, audit.gspure.present, named(audit.where(True))) == (1, 1, ["gspure"])


@pytest.mark.parametrize(
    ("gspure", "chance", "beyond"),
    [((9.0, 9.0, 9.0), 4.0, True), ((3.0, 4.0, 5.0), 4.0, False), ((3.0, 3.0, 3.0), 4.0, False)],
)
def test_only_more_than_random_pruning_in_every_scene_is_an_effect(gspure, chance: float, *, beyond: bool) -> None:
    drops = {f"s{i}": {"gspure": (0.5, x), "random_matched": (0.5, chance)} for i, x in enumerate(gspure)}
    text = told(benchmark(drops))[1]["Compared with random pruning"]
    assert ("no evidence of an effect" not in text) is beyond


def test_one_scene_is_not_called_reliable_or_unreliable_in_any_sentence() -> None:
    outcomes = of_scenes(1, gspure=(0.5, 17.5), random_matched=(0.5, 4.0), gof=(0.2, 17.0))
    verdict, points = told(outcomes)
    text = " ".join([verdict, *points.values()])
    for phrase in ("reliabl", "scenes", "every scene", "AUC", "evidence of", "significan", "interval"):
        assert phrase not in text, phrase
    assert points["Evidence"] == "1 scene, 1 random seed."


def test_the_audit_explains_a_high_auc_below_the_floor() -> None:
    outcomes = of_scenes(4, gspure=(0.5, 18.5))  # 9.5 dB: above the clean model, below the mean-colour image
    text = told(outcomes)[1]["GSPure"]
    assert "0.5 dB (0.5 to 0.5) below the floor" in text
    assert re.search(r"AUC.*1\.00 \(.*although it is too low to count as present", text)
    assert "although" not in told(of_scenes(4, gspure=(0.5, 5.0)))[1]["GSPure"]


def test_attacks_with_a_higher_score_are_named() -> None:
    drops = {f"s{i}": {"gspure": (0.5, 9.0), "plain": (0.5, 8.0 + 2 * i), "twin": (0.5, 9.0)} for i in range(3)}
    others = audit_of(benchmark(drops)).other_attacks
    assert ([c.attack for c in others.ahead], [c.attack for c in others.level]) == (["plain"], ["twin"])
    text = told(benchmark(drops))[1]["Compared with other attacks"]
    assert "1 of 2 other attacks has a higher mean Score" in text
    assert "plain by 1.0 dB (−1.0 to 3.0), but not in every scene" in text
    everywhere = {f"s{i}": {"gspure": (0.5, 9.0), "plain": (0.5, 10.0 + 2 * i)} for i in range(3)}
    assert "3.0 dB (1.0 to 5.0) in every scene" in told(benchmark(everywhere))[1]["Compared with other attacks"]


def test_the_audit_names_an_attack_that_is_stronger_at_equal_damage() -> None:
    drops = {"gspure": (1.0, 20.0), "gspure@0.3dB": (0.3, 6.0), "gof@0.3dB": (0.3, 15.0)}
    outcomes, sweeps = of_scenes(2, **drops), {"gspure": ["gspure", "gspure@0.3dB"], "gof": ["gof@0.3dB"]}
    audit = audit_of(outcomes, sweeps)
    assert not audit.other_attacks.ahead
    assert [(c.attack, c.damage) for c in audit.other_attacks.ahead_at_equal_damage] == [("gof", 0.3)]
    text = told(outcomes, sweeps)[1]["Compared with other attacks"]
    assert re.search(r"No other attack has a higher mean Score.*However.*GOF removes more", text)
    untested = told(of_scenes(2, gspure=(3.0, 20.0), gof=(3.0, 15.0)))[1]["Compared with other attacks"]
    assert "equal damage" not in untested
    drops["gof@0.3dB"] = (0.3, 5.0)
    once = told(of_scenes(2, **drops), sweeps)[1]["Compared with other attacks"]
    assert "However" not in once
    assert re.search(r"\(0.3 dB\), no other tested attack removes more of the message than GSPure in all scenes", once)
    drops |= {"gspure@2dB": (2.0, 25.0), "gof@2dB": (2.0, 20.0)}
    sweeps = {name: [variant for variant in drops if variant.startswith(name)] for name in sweeps}
    assert "(0.3 to 2 dB)" in told(of_scenes(2, **drops), sweeps)[1]["Compared with other attacks"]


@pytest.mark.parametrize(("scenes", "significant"), [(4, []), (8, ["gof"])])
def test_significance_is_claimed_only_where_it_is_possible(scenes: int, significant: list[str]) -> None:
    outcomes = of_scenes(scenes, gspure=(0.5, 9.0), gof=(0.5, 4.0))
    others = audit_of(outcomes).other_attacks
    assert [c.attack for c in others.significant] == significant
    assert ("can be significant" in told(outcomes)[1]["Evidence"]) is (others.p_attainable > SIGNIFICANT)


def test_scenes_and_seeds_are_counted() -> None:
    outcomes = benchmark({"a": {"gspure": (0.5, 9.0)}, "b": {"gspure": (0.5, 9.0)}}, seeds=3)
    assert told(outcomes)[1]["Evidence"].startswith("2 scenes, 3 random seeds per scene.")
    fewer = [o for o in outcomes if (o.scene, o.seed) != ("a", 2)]
    assert "2 to 3 random seeds" in told(fewer)[1]["Evidence"]


def test_seeds_without_any_effect_on_a_model_are_named() -> None:
    outcomes = benchmark({"a": {"gspure": (0.5, 9.0)}, "b": {"gspure": (0.5, 9.0)}}, seeds=3)
    assert audit_of(outcomes).repeated == 4
    assert "4 models have the same metrics as another seed" in told(outcomes)[1]["Evidence"]
    distinct = [
        replace(o, targets={**o.targets, "scene": measured("scene", 30 + o.seed)}) if o.variant == "unattacked" else o
        for o in outcomes
    ]
    assert "same metrics" not in told(distinct)[1]["Evidence"]


@pytest.mark.parametrize("lost", [20.0, 0.01])
def test_an_attack_that_changes_the_message_counts_whatever_carrier_is_declared(lost: float) -> None:
    outcomes = of_scenes(2, weak=(0.5, 2.0))
    outcomes += [attacked("reorder", 0.0, lost, f"s{i}", reached={"message": False}) for i in range(2)]
    audit, points = audit_of(outcomes), told(outcomes)[1]
    assert named(audit.not_reached) == ([] if lost > 1 else ["reorder"])
    assert ("did not survive reorder" in sentence(outcomes)) == (lost > 1)
    assert points.get("Incomplete carrier", "").startswith("Reorder") == (lost > 1)


def test_attacks_that_did_not_reach_the_carrier_are_not_judged() -> None:
    outcomes = of_scenes(2, gspure=(0.5, 20.0))
    outcomes += [attacked("noise", 1.0, 0.0, f"s{i}", reached={"message": False}) for i in range(2)]
    audit = audit_of(outcomes)
    assert (named(audit.attacks), named(audit.not_reached)) == (["gspure"], ["noise"])
    assert told(outcomes)[1]["Without effect"].startswith("Noise ")


def test_failures_are_listed_with_reason_and_models() -> None:
    outcomes = [*of_scenes(2, gspure=(0.5, 20.0)), outcome("gof", "s0", failure="gspure attack: out of memory")]
    assert told(outcomes)[1]["Failed"] == "GOF, on 1 of 2 models: gspure attack: out of memory"
    everything = [outcome(name, failure="no PyTorch") for name in ("unattacked", "gspure")]
    assert audit_of(everything).verdict == "failed"
    assert list(told(everything)[1]) == ["Failed"]


def test_without_key_the_scene_alone_is_reported() -> None:
    psnr = {"unattacked": math.inf, "gspure": 35.52, "gof": 30.0}
    outcomes = [
        Outcome("vanilla", "chair", name, {"scene": measured("scene", value, reference=RENDER)}, {"scene": 3})
        for name, value in psnr.items()
    ]
    audit = audit_of(outcomes)
    assert audit.verdict == "no key"
    assert [(row.variant, row.scene.mean) for row in audit.scene_psnr] == [("gspure", 35.52), ("gof", 30.0)]
    verdict, points = told(outcomes)
    assert (
        verdict == "Only the owner's key can tell whether this model holds a message, and whether an attack removed it."
    )
    assert "against renders of the unattacked model: 35.5 dB after GSPure; 30.0 dB after GOF." in points["The scene"]


def test_a_drop_that_is_shown_as_zero_has_no_direction() -> None:
    text = sentence(of_scenes(1, gspure=(-2e-5, 20.5)))
    assert "which lowers the PSNR of the message by 20.5 dB and changes that of the scene by 0.0 dB" in text


def test_the_psnr_of_the_scene_is_beside_the_damage_that_a_search_reached() -> None:
    strengths = {"unattacked": "", "noise@6dB": "fraction=1, 1.13 dB reached", "crop@6dB": "fraction=0.5"}
    targets = [{"scene": measured("scene", psnr, reference=RENDER)} for psnr in (math.inf, 41.0, 30.0)]
    outcomes = [
        Outcome("vanilla", "chair", name, target, {"scene": 3}, strength=strength)
        for (name, strength), target in zip(strengths.items(), targets, strict=True)
    ]
    assert "41.0 dB after noise, 6 dB (1.13 dB reached); 30.0 dB after crop, 6 dB." in told(outcomes)[1]["The scene"]


def test_without_controls_costs_are_reported_and_nothing_is_judged() -> None:
    outcomes = [o for o in of_scenes(2, gspure=(0.5, 20.0)) if not o.is_control]
    assert audit_of(outcomes).verdict == "no controls"
    assert told(outcomes)[1]["Effect of each attack"] == "GSPure (message −20.0 dB, scene −0.5 dB)."


DROPS = st.tuples(st.floats(-1, 5), st.floats(-1, 25))


@settings(max_examples=20, deadline=None)
@given(
    st.dictionaries(
        st.sampled_from("abc"), st.fixed_dictionaries({"gspure": DROPS, "x": DROPS, "y": DROPS}), min_size=1
    ),
    st.randoms(use_true_random=False),
)
def test_the_order_of_outcomes_does_not_matter_and_every_sentence_is_whole(drops, random) -> None:
    outcomes = benchmark(drops)
    verdict, points = told(outcomes)
    assert told(random.sample(outcomes, len(outcomes)))[0] == verdict
    for text in (verdict, *points.values()):
        assert text.endswith(".")
        assert not re.search(r"\bnan\b|None| [.,;:]|\.\.|  ", text), text


def test_phrases_round_to_tenths_and_sizes_have_no_sign() -> None:
    drop = Interval(-0.26, -1.0, 0.5, 0.5, 2)
    assert size(drop) == "0.3 dB (−0.5 to 1.0)"
    assert db(drop._replace(mean=-0.04)) == "0.0 dB (−1.0 to 0.5)"
    assert listed(f"n{i}" for i in range(15)).endswith("n11 and 3 more")
    assert listed(["a (1, 2)", "b"]) == "a (1, 2); and b"


def test_tables_of_another_run_are_refused(tmp_path: Path, capsys) -> None:
    for name, drop in (("a", 20.0), ("b", 10.0)):
        write_results(tmp_path / f"{name}.csv", of_scenes(2, gspure=(0.5, drop)))
        write_record(tmp_path / f"{name}.csv", inputs={}, settings={}, kind="table")
    out = {"--out": "c.csv", "--survival": "s.csv", "--matched": "m.csv", "--markdown": "c.md"}
    words = [word for option, file in out.items() for word in (option, str(tmp_path / file))]
    assert main(["contest", "--table", str(tmp_path / "a.csv"), *words]) == 0
    for option, file in (("--survival", "s.csv"), ("--contest", "c.csv"), ("--matched", "m.csv")):
        command = ["report", option, str(tmp_path / file), "--out", str(tmp_path / "r.html"), "--table"]
        assert main([*command, str(tmp_path / "b.csv")]) == 2
        printed = capsys.readouterr().err
        assert f"{file}: table: expected {known_digest(tmp_path / 'b.csv')}" in printed
        assert str(tmp_path / "b.csv") in printed
        assert main([*command, str(tmp_path / "a.csv")]) == 0


def test_figures_of_the_table_of_another_run_are_refused(tmp_path: Path, capsys) -> None:
    for name, drop in (("a", 20.0), ("b", 10.0)):
        write_results(tmp_path / f"{name}.csv", outcomes := of_scenes(2, gspure=(0.5, drop)))
        write_record(tmp_path / f"{name}.csv", inputs={}, settings={}, kind="table")
    figure = str(tmp_path / "figures" / outcomes[0].condition.key / "tradeoff.png")
    condition = ["--condition", outcomes[0].condition.key, "--out", figure]
    assert main(["figures", "tradeoff", "--table", str(tmp_path / "a.csv"), *condition]) == 0
    for table, status in (("b", 2), ("a", 0)):
        capsys.readouterr()
        page = ["--figures", figure, "--out", str(tmp_path / "r.html")]
        assert main(["report", "--table", str(tmp_path / f"{table}.csv"), *page]) == status
        assert ("tradeoff.png: table: expected" in capsys.readouterr().err) == bool(status)


def test_the_page_opens_with_the_audit_and_names_the_files(tmp_path: Path) -> None:
    write_results(tmp_path / "results.csv", of_scenes(2, gspure=(0.5, 20.0), gof=(3.0, 4.0)))
    table = ["--table", str(tmp_path / "results.csv")]
    out = {"--out": "contest.csv", "--survival": "survival.csv", "--matched": "matched.csv", "--markdown": "contest.md"}
    assert main(["contest", *table, *(w for option, name in out.items() for w in (option, str(tmp_path / name)))]) == 0
    given_files = {"--contest": "contest.csv", "--survival": "survival.csv", "--out": "r.html"}
    words = [word for option, name in given_files.items() for word in (option, str(tmp_path / name))]
    assert main(["report", *table, *words]) == 0
    page = Page(tmp_path / "r.html")
    text = page.text.split("Files and records", 1)[1]  # below the contents
    assert text.index("The message survived 1 of 2 attacks") < text.index("Limitations")
    assert text.index("Limitations") < text.index("Survival of the message")
    for name in ("results.csv", "survival.csv", "contest.csv"):
        assert name in [link["href"] for link in page.all("a")]
    assert "nan" not in text.lower().split()
