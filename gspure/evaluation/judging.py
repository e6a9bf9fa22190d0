"""From outcomes to results: whether each owner can still read the message, and prove it."""

from collections.abc import Iterator, Mapping, Sequence
from math import nan
from typing import Final

import numpy as np

from gspure.evaluation.evidence import Evidence, JobEvidence
from gspure.evaluation.outcomes import Outcome, by_model
from gspure.evaluation.results import (
    ADAPTS,
    GONE,
    KEY_ONLY,
    PROVEN,
    PUBLISHED,
    READABLE,
    TRACES,
    OwnerName,
    Result,
    Word,
    better,
)
from gspure.metrics import legibility
from gspure.metrics.bit_evidence import BitEvidence
from gspure.metrics.detection import Detection
from gspure.metrics.names import is_message_free
from gspure.metrics.proof import COARSEST, SIGNIFICANCE, Proof, Traces, prove, rank_p
from gspure.metrics.targets import ADAPTIVE, SCENE, is_picture

LEAST_CLEAN: Final = 8  # clean models of a t-test; with fewer, almost nothing passes it, and they only can refute

CleanEvidence = Mapping[str, Sequence[Evidence]]  # by extraction: of models that never held the message


def judged(outcomes: Sequence[Outcome], attacks: Mapping[str, Sequence[str]]) -> list[Result]:
    """Return the results of all outcomes, in their order; `attacks` name the variants that are strengths of each."""
    attack_of = {variant: attack for attack, variants in attacks.items() for variant in variants}
    results: list[Result] = []
    for alike in by_model(outcomes).values():
        clean = _clean_evidence(alike)
        for o in alike:
            results += _results(o, clean, attack_of.get(o.variant, o.variant))
    return results


def _clean_evidence(outcomes: Sequence[Outcome]) -> CleanEvidence:
    """Return what every extraction shows of the message in models that never held it."""
    clean = [o for o in outcomes if is_message_free(o.variant)]
    names = dict.fromkeys(name for o in clean for name in o.evidence)
    return {name: [o.evidence[name] for o in clean if name in o.evidence] for name in names}


def _results(o: Outcome, clean: CleanEvidence, attack: str) -> Iterator[Result]:
    """Yield a row for each owner, and for each detector; one of no owner if nothing reads a message."""
    row = _without_owner(o, attack)
    others = {} if is_message_free(o.variant) else clean
    pictures = [name for name in o.messages if is_picture(name)]
    for name in pictures:
        owner: OwnerName = ADAPTS if name == ADAPTIVE else PUBLISHED
        of_owner = row._replace(owner=owner, extraction=name, reached=o.reaches(name))
        tried = dict.fromkeys([pictures[0], name])  # an owner who adapts also extracts as published
        yield _of_picture(of_owner, o, [*tried], others)
    for name, detection in o.detections.items():
        of_detector = row._replace(owner=PUBLISHED, extraction=name, reached=o.reaches(name), reading=detection.level)
        bits = o.bits.get(name)
        yield _of_bits(of_detector, bits) if bits else _of_score(of_detector, detection)
    for name, reason in o.detector_errors.items():
        yield row._replace(owner=PUBLISHED, extraction=name, failure=reason)
    if not pictures and not o.detections and not o.detector_errors:
        yield row


def _without_owner(o: Outcome, attack: str) -> Result:
    """Return what a row holds of the attack and the scene."""
    scene = o.targets.get(SCENE)
    return Result(
        condition=o.condition,
        scene=o.scene,
        seed=o.seed,
        variant=o.variant,
        entry=o.entry,
        attack=attack,
        wanted=o.wanted,
        strength=o.strength,
        damage=o.damage,
        fidelity=o.fidelity,
        coverage_lost=o.coverage_lost,
        scene_values=scene.values if scene else {},
        pruned_share=o.pruned_share,
        failure=o.failure,
        run=o.run,
    )


def _of_picture(row: Result, o: Outcome, tried: Sequence[str], clean: CleanEvidence) -> Result:
    """Return a row with what an owner reads who tries some extractions, that as published first."""
    if row.extraction in o.unreadable:
        return row._replace(word=GONE, failure=o.unreadable[row.extraction])
    row = row._replace(message_values=o.targets[row.extraction].values)
    if row.extraction not in o.evidence:
        return row
    names = [name for name in tried if name in o.evidence and counts(o.evidence[name], clean.get(name, ()))]
    proofs = [proof_of(o.evidence[name], clean.get(name, ())) for name in names]
    if not proofs:
        return row._replace(word=GONE)
    legibilities = [o.evidence[name].legibility for name in names]
    proof = min(proofs, key=lambda one: one.p)
    return row._replace(
        trace=proof.trace,
        legibility=max(legibilities),
        z=proof.z,
        p=proof.p if proof.candidates else nan,
        level=proof.level,
        candidates=proof.candidates,
        clean_models=proof.clean_models,
        twins=proof.twins,
        word=better([word_of(one, max(legibilities)) for one in proofs]),
    )


def proof_of(evidence: Evidence, clean: Sequence[Evidence]) -> Proof:
    """Return the proof that one extraction gives; clean models count only if there are at least `LEAST_CLEAN`."""
    traces = Traces(
        message=0.0 if evidence.is_blank else evidence.trace,
        candidates=np.array(evidence.candidates),
        clean=np.array([model.trace for model in clean] if len(clean) >= LEAST_CLEAN else []),
        twins=np.array(evidence.twins),
        two_sided=not evidence.is_fitted,
    )
    return prove(traces)


def counts(evidence: Evidence, clean: Sequence[Evidence]) -> bool:
    """Return whether an extraction can prove anything: it has a test against clean models, or needs none.

    With too few of them, it must not show the message in any, and a key that learned proves nothing: such keys show
    their message in most models that never held it.
    """
    if len(clean) >= LEAST_CLEAN:
        return True
    is_untested = evidence.is_fitted and bool(evidence.candidates)
    return not is_untested and not any(map(_shows_message, clean))


def _shows_message(control: Evidence) -> bool:
    """Return whether an extraction from a clean model shows the message, or its negative, rather than any candidate."""
    if not control.candidates:
        return control.legibility >= legibility.TRACES
    traces = np.array([control.trace, *control.candidates])
    strengths = traces if control.is_fitted else np.abs(traces)
    return not control.is_blank and rank_p(float(strengths[0]), strengths[1:]) <= 1 / len(traces)


def word_of(proof: Proof, legible: float) -> Word:
    """Return whether a message is readable, shows traces, is proven only, or gone.

    An extraction that shows the message no better than from a redrawn twin shows what the key holds. Without
    candidates, nothing is proven: what can be recognized counts.
    """
    is_legible = legible >= legibility.TRACES
    if not proof.candidates and proof.p_twins is not None and proof.p_twins > COARSEST:
        return KEY_ONLY if is_legible else GONE
    if proof.candidates and not proof.is_proven:
        others = [proof.p_candidates] if proof.p_clean is None else [proof.p_candidates, proof.p_clean]
        return KEY_ONLY if max(others) <= proof.level <= COARSEST else GONE
    if legible >= legibility.READABLE:
        return READABLE
    if is_legible:
        return TRACES
    return PROVEN if proof.candidates else GONE


def word_left(evidence: JobEvidence) -> Word:
    """Return what a job alone shows of the message, by the best of its extractions; no clean model is asked."""
    pictures = [one for one in evidence.pictures.values() if counts(one, ())]
    words = [word_of(proof_of(one, ()), one.legibility) for one in pictures]
    words += [word_of_bits(one) for one in evidence.bits.values()]
    return better(words) if words else GONE


def word_of_bits(evidence: BitEvidence) -> Word:
    """Return whether all bits are read, or enough of them that it is no chance."""
    if evidence.p <= _level_of(evidence) <= COARSEST:
        return READABLE if evidence.correct == evidence.bits else PROVEN
    return GONE


def _level_of(evidence: BitEvidence) -> float:
    return max(SIGNIFICANCE, 2.0**-evidence.bits)


def _of_bits(row: Result, evidence: BitEvidence) -> Result:
    """Return a row with the bits that the majority of views shows."""
    return row._replace(
        p=evidence.p,
        level=_level_of(evidence),
        correct=evidence.correct,
        bits=evidence.bits,
        word=word_of_bits(evidence),
    )


def _of_score(row: Result, detection: Detection) -> Result:
    """Return a row with the scores of a detector; without clean views to compare them with, they prove nothing."""
    if detection.bits or detection.least_p > COARSEST:
        return row
    level = max(SIGNIFICANCE, detection.least_p)
    word: Word = READABLE if detection.p <= level else GONE
    return row._replace(p=detection.p, level=level, word=word)
