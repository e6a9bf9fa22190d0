"""The answer of an audit: attacks by damage, controls, and the verdict of every owner, as text and as JSON."""

import json
from dataclasses import replace

from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.survival import survival
from gspure.report.answer import Answer, answers
from gspure.scan.verdict import LIKELY, NOTHING, UNLIKE
from tests.contest_cases import benchmark, measured, outcome


def answer_of(outcomes) -> Answer:
    (answer,) = answers(outcomes, survival(outcomes))
    return answer


def adaptive(outcomes, drop: float) -> list[Outcome]:
    """The outcomes with a second extraction, whose PSNR the attack lowers by `drop`."""
    levels = {"unattacked": 28.0, "gof": 28.0 - drop}
    return [
        replace(
            o,
            targets={**o.targets, "message_adaptive": measured("m", levels.get(o.variant, 8.0))},
            before=replace(o.before, targets={**o.before.targets, "message_adaptive": measured("m", 28.0)}),
        )
        for o in outcomes
    ]


def test_lines_are_attacks_by_damage_then_controls_then_the_verdict():
    lines = [*answer_of(benchmark({"room": {"noise": (0.9, 2.0), "gof": (0.4, 20.0)}})).lines()]
    assert lines[1].split() == ["attack", "damage", "dB", "message", "dB", "left", "verdict"]
    assert lines[2].split() == ["GOF", "0.4", "8.0", "0%", "lost"]
    assert lines[3].split() == ["noise", "0.9", "26.0", "89%", "survives"]
    assert lines[4].startswith("controls: clean model 8.0, wrong key 7.0")
    assert lines[5] == "BROKEN: the message is lost at 0.4 dB of damage (GOF)."


def test_every_owner_has_a_damage_of_their_own():
    answer = answer_of(adaptive(benchmark({"room": {"gof": (0.4, 20.0)}}), 2.0))
    assert answer.audit.sentence.endswith("(GOF); an owner who adapts keeps it.")
    assert [line.split()[-2:] for line in list(answer.lines())[1:3]] == [["who", "adapts"], ["lost", "survives"]]
    lost = json.loads(json.dumps(answer.facts()))["lost"]
    assert (round(lost["message"]["damage"], 6), lost["message_adaptive"]["damage"]) == (0.4, None)


def test_without_a_key_nothing_is_said_about_a_message():
    answer = answer_of([outcome(name, targets={"scene": 30.0}) for name in ("unattacked", "gspure")])
    first, header, row, verdict = answer.lines()
    assert (first, header.split()) == ("sis", ["attack", "damage", "dB", "scene", "dB"])
    assert row.split() == ["GSPure", "0.0", "30.0"]
    assert verdict.startswith("No verdict: only the owner's key can tell")


def test_the_key_numbers_are_those_of_the_verdict():
    answer = answer_of(benchmark({"room": {"noise": (0.9, 2.0), "gof": (0.4, 20.0)}}))
    assert [number for number, _ in answer.key_numbers()] == ["0.4 dB", "28.0 → 8.0 dB", "7.0 dB", "1 scene, 1 seed"]
    scans = [{"before": LIKELY, "after": NOTHING}, {"before": LIKELY, "after": UNLIKE}]
    detected = [[number for number, _ in answer.key_numbers(scans[:count])][3] for count in (1, 2)]
    assert detected == ["yes → no", "2 of 2 → 0 of 2"]
    assert answer.pictured({"noise", "gof", "unattacked"}) == ["unattacked", "gof", "noise"]
    held = answer_of(benchmark({"room": {"noise": (0.9, 2.0)}}))
    assert [number for number, _ in held.key_numbers()][:2] == ["none", "28.0 → 26.0 dB"]


def test_a_failed_attack_comes_last():
    failed = outcome("crop", failure="no memory")
    answer = answer_of([failed, *benchmark({"s0": {"noise": (0.9, 2.0), "gof": (0.4, 20.0)}})])
    assert [row.variant for row in answer.attacks] == ["gof", "noise", "crop"]
