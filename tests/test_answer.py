"""The owner's audit: a verdict from the radius, its limits, and the answer as text and as JSON."""

import json
from collections.abc import Sequence
from dataclasses import replace
from math import isnan
from typing import Any

import pytest

from gspure.evaluation.evidence import Evidence, SceneChange
from gspure.evaluation.judging import judged
from gspure.evaluation.outcomes import Outcome, with_references
from gspure.metrics.bit_evidence import BitEvidence
from gspure.report.answer import Answer, answers
from gspure.report.audit import NO_KEY, is_judged
from gspure.scan.verdict import LIKELY, NOTHING, UNLIKE
from tests.outcome_cases import NOTHING as FAINT
from tests.outcome_cases import PLAIN, PROTOCOL, outcome, read, shown
from tests.outcome_cases import with_evidence as attacked


def answer_of(outcomes: Sequence[Outcome]) -> Answer:
    (answer,) = answers(judged(with_references(outcomes), {}))
    return answer


def models_of(*scenes: str, **attacks: tuple[float, Any]) -> list[Outcome]:
    """A marked model of each scene, and its attacks: damage and evidence."""
    outcomes = []
    for scene in scenes or ("room",):
        outcomes.append(attacked("unattacked", 0.0, scene, message=PLAIN))
        outcomes += [attacked(name, damage, scene, message=left) for name, (damage, left) in attacks.items()]
        outcomes.append(attacked("clean", 0.0, scene, message=FAINT))
        outcomes.append(attacked("wrong_key", 0.0, scene, message=FAINT))
    return outcomes


KEYLESS = [outcome(name, targets={"scene": 30.0}) for name in ("unattacked", "gspure")]
UNAPPLIED = [outcome(name, failure="not applicable: no rows") for name in ("unattacked", "gspure")]


@pytest.mark.parametrize(
    ("outcomes", "verdict", "text"),
    [
        (models_of(gof=(0.5, FAINT)), "broken", "BROKEN: the message is gone at 0.50 dB of damage (GOF)."),
        (models_of(gof=(1.02, FAINT)), "broken", "gone at 1.0 dB of damage"),
        (models_of(gof=(1.4, FAINT), jpeg=(0.9, PLAIN)), "weak", "WEAK: the message is gone at 1.4 dB of damage (GOF)"),
        (models_of(gof=(2.6, FAINT)), "holds", "HOLDS: the message is gone at 2.6 dB of damage (GOF)"),
        (models_of(gof=(2.1, PLAIN)), "holds", "the message is not gone after any attack of at most 2.1 dB of damage"),
        (models_of(gof=(0.3, PLAIN)), "unknown", "no attack was tested with more than 0.3 dB of damage"),
        (KEYLESS, "unknown", NO_KEY),
        (UNAPPLIED, "unknown", "every variant is without results"),
        ([attacked("unattacked", 0.0, message=FAINT), *models_of(gof=(1.0, FAINT))[1:]], "not present", "not proven"),
        (
            [*models_of(gof=(1.0, FAINT)), attacked("clean", 0.0, message=PLAIN)],
            "not present",
            "with this key, a model",
        ),
        ([attacked("unattacked", 0.0, message=Evidence(0.95, 1.0))], "unknown", "too few views or candidates"),
        ([read("unattacked", 32, 32), read("blur", 17, 32, 1.5)], "weak", "the mark in renders is gone at 1.5 dB"),
    ],
)
def test_each_verdict_is_given_where_it_applies(outcomes: Any, verdict: str, text: str) -> None:
    audit = answer_of(outcomes).audit
    assert (audit.verdict, text in audit.sentence) == (verdict, True), audit.sentence


LOST = models_of(noise=(0.9, shown(0.3, 0.5)), gof=(0.4, FAINT))


def test_lines_are_attacks_by_damage_then_controls_then_the_verdict() -> None:
    lines = [*answer_of(LOST).lines()]
    assert lines[1].split() == ["attack", "damage", "dB", "message", "dB", "legible", "p", "as", "published"]
    assert lines[2].split() == ["GOF", "0.40", "20.0", "0%", "0.9", "gone"]
    assert lines[3].split() == ["noise", "0.90", "20.0", "50%", "0.005", "traces"]
    assert lines[4] == "traces: ≥ 40% legible; p: probability by chance"
    assert lines[5] == "controls: clean model gone, wrong key gone"
    assert lines[6] == "BROKEN: the message is gone at 0.40 dB of damage (GOF)."
    failed = answer_of([outcome("crop", failure="no memory", protocol="shared", initialization="both"), *LOST])
    assert [(row.variant, row.failure) for row in failed.attacks] == [("gof", ""), ("noise", ""), ("crop", "no memory")]
    compared = {name: SceneChange(None, fidelity, 0.0) for name, fidelity in (("noise", 20.0), ("gof", 40.0))}
    faithful = [outcome(name, targets={"scene": 30.0}, change=change) for name, change in compared.items()]
    last = outcome("crop", failure="no memory")
    assert [row.variant for row in answer_of([last, *faithful]).attacks] == ["gof", "noise", "crop"]


def test_a_removed_format_has_no_level_of_the_message() -> None:
    removed = outcome("distil", targets={"scene": 29.9}, unreadable={"message": "removed"}, **PROTOCOL)
    answer = answer_of([removed, *LOST])
    first = answer.attacks[0]
    assert (first.variant, first.published, isnan(first.level)) == ("distil", "gone", True)
    assert "no candidates" not in " ".join(answer.audit.remarks)


def test_the_verdict_follows_the_owner_who_adapts() -> None:
    outcomes = [
        attacked("unattacked", 0.0, message=PLAIN, message_adaptive=PLAIN),
        attacked("gof", 0.4, message=FAINT, message_adaptive=shown(0.3, 0.2)),
        attacked("gspure", 1.4, message=FAINT, message_adaptive=FAINT),
    ]
    answer = answer_of(outcomes)
    assert answer.audit.sentence == (
        "WEAK: the message is gone at 1.4 dB of damage (GSPure); it is no longer readable at 0.40 dB of damage (GOF); "
        "as published, it is gone at 0.40 dB of damage (GOF)."
    )
    assert [line.split()[-2:] for line in [*answer.lines()][2:4]] == [["gone", "proven"], ["gone", "gone"]]
    facts = json.loads(json.dumps(answer.facts()))
    assert [round(radius["radius"], 6) for radius in facts["radii"]] == [0.4, 0.4, 1.4, 0.4]
    assert answer.pictured({"gof", "gspure", "unattacked"}) == ["unattacked", "gspure", "gof"]


def test_scenes_that_differ_are_counted() -> None:
    outcomes = [*models_of("a", gof=(0.4, FAINT)), *models_of("b", gof=(0.6, PLAIN))]
    answer = answer_of(outcomes)
    assert [(row.published, round(row.damage, 6)) for row in answer.attacks] == [("gone in 1 of 2", 0.5)]
    assert [number for number, _ in answer.key_numbers()][-1] == "2 scenes, 1 seed"


def test_remarks_name_the_null_a_wrong_key_that_reads_and_attacks_without_effect() -> None:
    leaking = [o for o in LOST if o.variant != "wrong_key"]
    leaking.append(attacked("wrong_key", 0.0, message=PLAIN))
    untouched = replace(attacked("rigid", 0.0, message=PLAIN), affects={"message": False})
    remarks = " ".join(answer_of([*leaking, untouched]).audit.remarks)
    assert "p ≤ 0.005 by its rank among 199 candidates, and by a t-test against 8 " in remarks
    for text in ("A wrong key shows the message", "one scene", "reads: rigid"):
        assert text in remarks
    others = models_of("vault", gof=(0.4, FAINT))
    assert ("readable in 1 of 2", "with a wrong key") in [*answer_of([*leaking, *others]).key_numbers()]
    many = attacked("gof", 0.4, message=Evidence(0.95, 1.0, 60 * PLAIN.candidates))
    assert "p ≤ 0.001 by its rank among 11940 candidates" in answer_of([many]).audit.remarks[0]


def test_without_a_key_nothing_is_said_about_a_message() -> None:
    first, header, row, verdict = answer_of(KEYLESS).lines()
    assert (first, header.split()) == ("sis", ["attack", "damage", "dB", "scene", "dB"])
    assert row.split() == ["GSPure", "0.00", "30.0"]
    assert verdict.startswith("No verdict: only the owner's key can tell")


def test_without_candidates_or_photographs_there_is_neither_a_p_nor_a_radius() -> None:
    change = SceneChange(None, 40.0, 0.0)
    known = {"evidence": {"message": Evidence(0.95, 1.0)}, "change": change, **PROTOCOL}
    targets = {"scene": 30.0, "message": 20.0}
    answer = answer_of([outcome(name, targets=targets, **known) for name in ("unattacked", "gof")])
    (attack,) = answer.attacks
    assert (attack.published, isnan(attack.p), next(answer.key_numbers())[0]) == ("readable", True, "no attack")


def test_a_verdict_on_a_mark_follows_from_its_own_rows_alone() -> None:
    bits = read("unattacked", 32, 32)
    detections = dict.fromkeys(("bits", "other"), bits.detections["bits"])
    rows = judged([replace(bits, detections=detections, bits={**bits.bits, "other": BitEvidence(0.9, 1, 32, 4)})], {})
    (answer,) = answers(rows)
    assert [row.extraction for row in rows if is_judged(row, answer.audit.extraction)] == ["bits"]
    assert answer.quantity == "correct bits %"


def test_a_scan_is_a_key_number_before_and_after() -> None:
    answer = answer_of(LOST)
    scans = [{"before": LIKELY, "after": NOTHING}, {"before": LIKELY, "after": UNLIKE}]
    found = [": ".join([*answer.key_numbers(scans[:count])][-2]).split(": ")[::2] for count in (1, 2)]
    assert found == [["found", "not found"], ["found in 2 of 2", "found in 0 of 2"]]
