"""The evaluation of an attack at the least strength that ends the message."""

from dataclasses import replace
from typing import Final

from gspure.attacks import find_attack
from gspure.attacks.strength import Strength
from gspure.errors import InputError
from gspure.evaluation.evaluate import Evaluation, evaluate
from gspure.evaluation.judging import word_left
from gspure.evaluation.plan import AttackSpec, Job, Until
from gspure.evaluation.results import PROVEN, READABLE, TRACES, Word

HALVINGS: Final = 7  # of the range of strengths
LEFT: Final[dict[Until, tuple[Word, ...]]] = {"gone": (READABLE, TRACES, PROVEN), "unreadable": (READABLE,)}


def searched(job: Job) -> Evaluation:
    """Run a job; with `AttackSpec.until`, at the least strength found that leaves the message gone or unreadable.

    That is the strongest if none does. The bisection assumes that a stronger attack leaves no more of the message, and
    judges without clean models, which other jobs read; the results judge the strength found with them.

    Raises
    ------
    InputError
        If the model, a view, the key or a setting is invalid.

    """
    spec = job.case
    has_message = job.owner is not None or any(detector.message for detector in job.detectors.values())
    if not isinstance(spec, AttackSpec) or spec.until is None or not has_message:
        return evaluate(job)
    strength = find_attack(spec.name).strength
    if strength is None:
        raise InputError(job.variant, "attack", expected="one with a strength", found=spec.name)
    weak = 0.0
    strong = 1.0
    evaluation = _at(strong, strength, job, spec)
    if _is_left(evaluation, spec.until):
        return evaluation
    position = strong
    for _ in range(HALVINGS):
        position = (weak + strong) / 2
        evaluation = _at(position, strength, job, spec)
        if _is_left(evaluation, spec.until):
            weak = position
        else:
            strong = position
    return evaluation if position == strong else _at(strong, strength, job, spec)


def _at(position: float, strength: Strength, job: Job, spec: AttackSpec) -> Evaluation:
    """Run a job at a position between the weakest (0) and the strongest (1) of the strengths."""
    settings = {**spec.settings, strength.setting: strength.at(position)}
    return evaluate(replace(job, case=replace(spec, settings=settings, until=None)))


def _is_left(evaluation: Evaluation, until: Until) -> bool:
    return word_left(evaluation.evidence) in LEFT[until]
