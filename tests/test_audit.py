"""The owner's audit: one of six verdicts, which agrees with every row of the table of survival."""

from dataclasses import replace

import pytest

from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.survival import survival
from gspure.metrics.detection import Detection
from gspure.report.audit import NO_KEY, Audit, audits
from tests.contest_cases import benchmark, measured, outcome


def audit_of(outcomes) -> Audit:
    (audit,) = audits(outcomes, survival(outcomes))
    return audit


def of_scenes(count, **drops):
    return benchmark({f"s{i}": drops for i in range(count)})


def detected(variant: str, scene: str = "s0", length: int = 16, **present: bool) -> Outcome:
    detections = {name: Detection(50.0, 1.0, 0.0, 0.0, is_there, 9, length) for name, is_there in present.items()}
    return replace(outcome(variant, targets={"scene": 30.0}), scene=scene, before=None, detections=detections)


UNAPPLIED = [outcome(name, failure="not applicable: no rows") for name in ("unattacked", "gspure")]
FLAT = replace(outcome("unattacked", targets={"message": 9.0}), targets={"message": measured("message", 9.0, 0.0)})


@pytest.mark.parametrize(
    ("outcomes", "verdict", "text"),
    [
        (of_scenes(1, gof=(0.5, 2.0), jpeg=(2.2, 20.0)), "holds", "no tested attack with at most 2 dB of damage"),
        (of_scenes(2, gof=(1.02, 20.0), jpeg=(1.9, 25.0)), "broken", "the message is lost at 1.0 dB of damage (GOF)."),
        (of_scenes(1, gof=(1.4, 20.0), jpeg=(0.9, 2.0)), "weak", "the message is lost at 1.4 dB of damage (GOF)."),
        (
            benchmark({"a": {"gof": (1.0, 20.0)}, "b": {"gof": (1.0, 2.0)}}),
            "weak",
            "remove the message from some scenes",
        ),
        (of_scenes(2, gof=(2.03, 19.0), crop=(0.5, 20.0), jpeg=(2.2, 25.0)), "broken", "0.5 dB of damage (crop)"),
        (of_scenes(2, gof=(2.5, 25.0)), "unknown", "no attack was tested with at most 2 dB"),
        ([o for o in of_scenes(2, gof=(1.0, 3.0)) if not o.is_control], "unknown", "no negative control"),
        ([outcome(n, targets={"scene": 30.0}) for n in ("unattacked", "gspure")], "unknown", NO_KEY),
        (UNAPPLIED, "unknown", "every variant is without results"),
        ([o for o in of_scenes(2, gof=(0.5, 9.0)) if o.variant != "unattacked"], "unknown", "unattacked model"),
        (
            [o for o in of_scenes(1, gof=(0.5, 3.0)) if o.variant != "clean"]
            + [outcome("clean", "s0", targets={"message": 27.5})],
            "not present",
            "does not exceed the controls",
        ),
        ([FLAT], "not present", "Look at the extraction"),
        ([replace(o, affects={"message": False}) for o in of_scenes(1, gof=(0.5, 0.0))], "not affected", "no attack"),
        ([detected(n, mark=False) for n in ("unattacked", "clean")], "not present", "mark (mark)"),
        ([detected("unattacked", length=0, mark=None)], "unknown", "too few views"),
    ],
)
def test_each_verdict_is_given_where_it_applies(outcomes, verdict: str, text: str) -> None:
    audit = audit_of(outcomes)
    assert (audit.verdict, text in audit.sentence) == (verdict, True), audit.sentence
    assert "{" not in audit.sentence


def test_conditions_are_judged_apart() -> None:
    own_poses = [replace(o, protocol="own") for o in of_scenes(1, gof=(0.5, 2.0))]
    both = [*of_scenes(1, gof=(0.5, 20.0)), *own_poses]
    verdicts = {audit.condition.protocol: audit.verdict for audit in audits(both, survival(both))}
    assert verdicts == {"": "broken", "own": "holds"}
