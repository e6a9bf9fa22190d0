"""The owner's audit, one of six verdicts for each owner, and its answer as text and as JSON."""

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.survival import survival
from gspure.metrics.detection import Detection
from gspure.report.answer import Answer, answers
from gspure.report.audit import NO_KEY, audits
from gspure.scan.verdict import LIKELY, NOTHING, UNLIKE
from tests.contest_cases import benchmark, measured, outcome


def answer_of(outcomes: Sequence[Outcome]) -> Answer:
    (answer,) = answers(outcomes, survival(outcomes))
    return answer


def of_scenes(count: int, **drops: tuple[float, float]) -> list[Outcome]:
    return benchmark({f"s{i}": drops for i in range(count)})


def without(variant: str, outcomes: Sequence[Outcome]) -> list[Outcome]:
    return [o for o in outcomes if o.variant != variant]


def detected(variant: str, length: int = 16, **present: bool | None) -> Outcome:
    detections = {name: Detection(50.0, 1.0, 0.0, 0.0, is_there, 9, length) for name, is_there in present.items()}
    return replace(outcome(variant, targets={"scene": 30.0}), before=None, detections=detections)


KEYLESS = [outcome(name, targets={"scene": 30.0}) for name in ("unattacked", "gspure")]
UNAPPLIED = [outcome(name, failure="not applicable: no rows") for name in ("unattacked", "gspure")]
FLAT = replace(outcome("unattacked", targets={"message": 9.0}), targets={"message": measured("message", 9.0, 0.0)})
MIXED = benchmark({"a": {"gof": (1.0, 20.0)}, "b": {"gof": (1.0, 2.0)}})
LEAKING = [*without("clean", of_scenes(1, gof=(0.5, 3.0))), outcome("clean", "s0", targets={"message": 27.5})]
UNTOUCHED = [replace(o, affects={"message": False}) for o in of_scenes(1, gof=(0.5, 0.0))]
UNCONTROLLED = [o for o in of_scenes(2, gof=(1.0, 3.0)) if not o.is_control]


@pytest.mark.parametrize(
    ("outcomes", "verdict", "text"),
    [
        (of_scenes(1, gof=(0.5, 2.0), jpeg=(2.2, 20.0)), "holds", "no tested attack with at most 2 dB of damage"),
        (of_scenes(2, gof=(1.02, 20.0), jpeg=(1.9, 25.0)), "broken", "the message is lost at 1.0 dB of damage (GOF)."),
        (of_scenes(1, gof=(1.4, 20.0), jpeg=(0.9, 2.0)), "weak", "the message is lost at 1.4 dB of damage (GOF)."),
        (MIXED, "weak", "remove the message from some scenes"),
        (of_scenes(2, gof=(2.03, 19.0), crop=(0.5, 20.0), jpeg=(2.2, 25.0)), "broken", "0.5 dB of damage (crop)"),
        (of_scenes(2, gof=(2.5, 25.0)), "unknown", "no attack was tested with at most 2 dB"),
        (UNCONTROLLED, "unknown", "no negative control"),
        (KEYLESS, "unknown", NO_KEY),
        (UNAPPLIED, "unknown", "every variant is without results"),
        (without("unattacked", of_scenes(2, gof=(0.5, 9.0))), "unknown", "unattacked model"),
        (LEAKING, "not present", "does not exceed the controls"),
        ([FLAT], "not present", "Look at the extraction"),
        (UNTOUCHED, "not affected", "no attack"),
        ([detected(n, mark=False) for n in ("unattacked", "clean")], "not present", "mark (mark)"),
        ([detected("unattacked", length=0, mark=None)], "unknown", "too few views"),
    ],
)
def test_each_verdict_is_given_where_it_applies(outcomes: Any, verdict: str, text: str) -> None:
    audit = answer_of(outcomes).audit
    assert (audit.verdict, text in audit.sentence) == (verdict, True), audit.sentence
    assert "{" not in audit.sentence


def test_conditions_are_judged_apart() -> None:
    own_poses = [replace(o, protocol="own") for o in of_scenes(1, gof=(0.5, 2.0))]
    both = [*of_scenes(1, gof=(0.5, 20.0)), *own_poses]
    verdicts = {audit.condition.protocol: audit.verdict for audit in audits(both, survival(both))}
    assert verdicts == {"": "broken", "own": "holds"}


LOST = of_scenes(1, noise=(0.9, 2.0), gof=(0.4, 20.0))


def test_lines_are_attacks_by_damage_then_controls_then_the_verdict() -> None:
    lines = [*answer_of(LOST).lines()]
    assert lines[1].split() == ["attack", "damage", "dB", "message", "dB", "left", "verdict"]
    assert lines[2].split() == ["GOF", "0.4", "8.0", "0%", "lost"]
    assert lines[3].split() == ["noise", "0.9", "26.0", "89%", "survives"]
    assert lines[4].startswith("controls: clean model 8.0, wrong key 7.0")
    assert lines[5] == "BROKEN: the message is lost at 0.4 dB of damage (GOF)."
    failed = answer_of([outcome("crop", failure="no memory"), *LOST])
    assert [row.variant for row in failed.attacks] == ["gof", "noise", "crop"]


def adaptive(o: Outcome) -> Outcome:
    """An outcome with a second extraction, whose PSNR the attack lowers by 2 dB."""
    levels = {"unattacked": 28.0, "gof": 26.0}
    after = {"message_adaptive": measured("m", levels.get(o.variant, 8.0))}
    first = outcome("unattacked", targets={"scene": 30.0, "message": 28.0, "message_adaptive": 28.0})
    return replace(o, targets=o.targets | after, before=first)


def test_every_owner_has_a_damage_of_their_own() -> None:
    answer = answer_of([*map(adaptive, of_scenes(1, gof=(0.4, 20.0)))])
    assert answer.audit.sentence.endswith("(GOF); an owner who adapts keeps it.")
    assert [line.split()[-2:] for line in list(answer.lines())[1:3]] == [["who", "adapts"], ["lost", "survives"]]
    lost = json.loads(json.dumps(answer.facts()))["lost"]
    assert (round(lost["message"]["damage"], 6), lost["message_adaptive"]["damage"]) == (0.4, None)


def test_without_a_key_nothing_is_said_about_a_message() -> None:
    first, header, row, verdict = answer_of(KEYLESS).lines()
    assert (first, header.split()) == ("sis", ["attack", "damage", "dB", "scene", "dB"])
    assert row.split() == ["GSPure", "0.0", "30.0"]
    assert verdict.startswith("No verdict: only the owner's key can tell")


def test_the_key_numbers_are_those_of_the_verdict() -> None:
    answer = answer_of(LOST)
    assert [number for number, _ in answer.key_numbers()] == ["0.4 dB", "28.0 → 8.0 dB", "7.0 dB", "1 scene, 1 seed"]
    scans = [{"before": LIKELY, "after": NOTHING}, {"before": LIKELY, "after": UNLIKE}]
    shown = [[number for number, _ in answer.key_numbers(scans[:count])][3] for count in (1, 2)]
    assert shown == ["yes → no", "2 of 2 → 0 of 2"]
    assert answer.pictured({"noise", "gof", "unattacked"}) == ["unattacked", "gof", "noise"]
    held = answer_of(of_scenes(1, noise=(0.9, 2.0)))
    assert [number for number, _ in held.key_numbers()][:2] == ["none", "28.0 → 26.0 dB"]
