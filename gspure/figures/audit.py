"""The owner's audit: what of a scheme's message survives which attack, at what price, and how sure that is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from textwrap import shorten
from typing import Final

from gspure.evaluation.contest import METHOD, Contest
from gspure.evaluation.outcomes import MESSAGE, REFERENCE, SCENE, Outcome
from gspure.evaluation.statistics import Interval, known_interval
from gspure.evaluation.summary import summarize
from gspure.evaluation.survival import MARGIN, Survival
from gspure.figures import rivalry
from gspure.figures.findings import spoken
from gspure.figures.wording import db, listed, loses, mirrored, plural, tenths

CRITERION: Final = (
    f"A message survives in a scene if its PSNR lies {MARGIN:g} dB or more above all that is seen of that scene where "
    "there is none: in a model without it, in another scene's model, in pictures of one colour. In parentheses: the "
    "smallest and the largest scene, or from six scenes on the 95% interval of the mean."
)

_REASON: Final = 160
"""Letters of the reason of a failure; all of it stands with the model."""

Point = tuple[str, str]
"""A label of a few words, and the sentences that belong to it."""


@dataclass(frozen=True)
class Audit:
    """What the owner of one scheme should know."""

    scheme: str
    verdict: str
    points: list[Point]


def audit(
    outcomes: Sequence[Outcome], survivals: Sequence[Survival] = (), contests: Sequence[Contest] = ()
) -> list[Audit]:
    """Return the audit of every scheme.

    Parameters
    ----------
    outcomes : sequence of Outcome
        All variants of all models; schemes stay in their order.
    survivals : sequence of Survival
        What `gspure.evaluation.survival.survival` says of them.
    contests : sequence of Contest
        What `gspure.evaluation.contest.contest` says of them.

    """
    found = []
    for scheme in dict.fromkeys(o.scheme for o in outcomes):
        ours = [o for o in outcomes if o.scheme == scheme]
        left = {(row.extraction, row.variant): row for row in survivals if row.scheme == scheme}
        main = {variant: row for (extraction, variant), row in left.items() if extraction == MESSAGE}
        bouts = [c for c in contests if c.scheme == scheme and c.extraction == MESSAGE]
        points = [
            *(_message(main) if main else _scene(ours)),
            *_other_extractions(left),
            *_off_path(ours),
            *rivalry.points(bouts),
            ("How sure", f"{_basis(ours)} {rivalry.certainty(bouts)}".strip()),
            *_untested(ours, main),
        ]
        found.append(Audit(_sentence_case(spoken(scheme)), _verdict(ours, main), points))
    return found


def _verdict(outcomes: Sequence[Outcome], main: Mapping[str, Survival]) -> str:
    if not (judged := _judged(main)):
        return _unjudged(outcomes, main)
    always, never = (sum(row.survives is state for row in judged) for state in (True, False))
    attacks, sometimes = plural(len(judged), "attack"), len(judged) - always - never
    partly = any(row.above_controls and row.present < row.above_controls.scenes for row in judged)
    where = "scene in which it is there at all" if partly else "scene"
    if never == len(judged):
        return f"The message survives none of {attacks}, in any {where}."
    if always == len(judged):
        return f"The message survives all of {attacks}, in every {where}."
    others = [f"{sometimes} in some only"] * bool(sometimes) + [f"{never} in none"] * bool(never)
    return f"Of {attacks}, the message survives {listed([f'{always} in every {where}', *others])}."


def _unjudged(outcomes: Sequence[Outcome], main: Mapping[str, Survival]) -> str:
    """Return why nothing can be said about survival."""
    if all(o.failure for o in outcomes):
        return "Nothing could be measured: everything failed."
    if not main:
        return "Whether a message survives was not measured: that takes the owner's key."
    if REFERENCE not in main:
        return "What the message was before any attack is not known, so nothing can be compared with it."
    if not any(row.above_controls for row in main.values()):
        return "Whether what is left is still a message was not judged: there are no controls to compare it with."
    if not any(row.present for row in main.values()):
        return "There is no message to lose: even before any attack, nothing stands out from the controls."
    return "No attack touched the message."


def _judged(main: Mapping[str, Survival]) -> list[Survival]:
    """Return the attacks that may have touched the message and met one that stood out, the gentlest first."""
    rows = (row for row in main.values() if row.variant != REFERENCE and row.reached is not False)
    return sorted((row for row in rows if row.present), key=_damage)


def _damage(row: Survival) -> float:
    return row.scene_drop.mean if row.scene_drop else inf


def _message(main: Mapping[str, Survival]) -> Iterator[Point]:
    """Yield what the message was before, what GSPure does to it, and which attacks leave it."""
    if (before := main.get(REFERENCE)) and before.above_controls:
        text = f"The message lies {_from_controls(before.above_controls)}."
        if before.present < before.above_controls.scenes:
            scenes = f"{before.present} of {plural(before.above_controls.scenes, 'scene')}"
            text += f" It stands out in {scenes}, and only there can it survive."
        yield "Before any attack", text
        if before.above_wrong_key:
            yield "The key", _secrecy(before.above_controls, before.above_wrong_key)
    if ours := main.get(METHOD):
        yield "GSPure", _attack(ours)
    judged = _judged(main)
    for state, label in ((True, "It survives"), (None, "It survives in some scenes"), (False, "It is gone after")):
        rows = [row for row in judged if row.survives is state]
        if rows:
            yield label, f"{_sentence_case(listed(map(_priced, rows)))}."
    if not judged:
        rows = sorted((r for r in main.values() if r.variant != REFERENCE), key=_damage)
        yield "All attacks", f"{_sentence_case(listed(map(_priced, rows)))}."


def _secrecy(right: Interval, over_wrong: Interval) -> str:
    shown = right.mean - over_wrong.mean
    text = f"A wrong one shows {db(over_wrong)} less than the right one"
    if shown < MARGIN:
        return f"{text}, and nothing that stands out from the controls."
    return (
        f"{text}, which is {tenths(shown)} dB above the highest control: some of the message is seen without the key."
    )


def _attack(row: Survival) -> str:
    if not (row.message_drop and row.scene_drop):
        return "What it takes is not known."
    text = f"The message {loses(row.message_drop)}, the scene {loses(row.scene_drop)}."
    if row.above_controls:
        survives = f", and survives in {row.survived} of {row.present}" if row.present else ""
        text += f" It then lies {_from_controls(row.above_controls)}{survives}."
    if row.told:
        bounds = f"{row.told.low:.2f} to {row.told.high:.2f}"
        text += f" It is told from a model without it with probability {row.told.auc:.2f} ({bounds}; 0.50 is chance)."
    return text


def _from_controls(margin: Interval) -> str:
    side, distance = ("above", margin) if margin.mean >= 0 else ("below", mirrored(margin))
    return f"{db(distance)} {side} the highest control"


def _priced(row: Survival) -> str:
    """Return an attack with what it costs message and scene."""
    cost = [f"{tenths(-drop.mean)}" if drop else "?" for drop in (row.message_drop, row.scene_drop)]
    scenes = f"; {row.survived} of {row.present}" if row.present and row.survives is None else ""
    return f"{spoken(row.variant)} (message {cost[0]}, scene {cost[1]} dB{scenes})"


def _scene(outcomes: Sequence[Outcome]) -> Iterator[Point]:
    """Yield what is known of models without a message: the scene alone."""
    rows = [row for row in summarize(outcomes) if row.variant != REFERENCE and row.scene]
    shown = sorted(((row.scene.mean, row) for row in rows if row.scene), key=lambda pair: -pair[0])
    if shown:
        names = (f"{spoken(row.variant)} {db(row.scene)}" for _, row in shown if row.scene)
        against = "" if all(o.against_truth for o in outcomes) else " against what the unattacked model shows"
        yield "The scene", f"PSNR after each attack{against}: {listed(names)}."


def _other_extractions(left: Mapping[tuple[str, str], Survival]) -> Iterator[Point]:
    for (extraction, variant), row in left.items():
        if variant == METHOD and extraction != MESSAGE:
            yield _sentence_case(f"{spoken(extraction)}, after GSPure"), _attack(row)


def _off_path(outcomes: Sequence[Outcome]) -> Iterator[Point]:
    """Yield what GSPure takes when one looks from beside the path on which it was decided what to prune."""
    ours = [o for o in outcomes if o.variant == METHOD]
    on, beside = ([_drop(side, target) for target in (MESSAGE, SCENE)] for side in (ours, [o.aside() for o in ours]))
    if all(on) and all(beside):
        message, scene = (f"{loses(b)} there (on it {loses(a)})" for a, b in zip(on, beside, strict=True) if a and b)
        yield "Beside the cameras' path", f"After GSPure the message {message}, and the scene {scene}."


def _drop(outcomes: Sequence[Outcome], target: str) -> Interval | None:
    return known_interval({(o.scene, o.seed): o.psnr_drop(target) for o in outcomes})


def _basis(outcomes: Sequence[Outcome]) -> str:
    """Return how many scenes and seeds the numbers rest on."""
    measured = {(o.scene, o.seed) for o in outcomes if not o.failure}
    scenes = {scene for scene, _ in measured}
    seeds = sorted({sum(scene == other for other, _ in measured) for scene in scenes})
    each = f"{seeds[0]} to {seeds[-1]} seeds" if len(seeds) > 1 else plural(seeds[0] if seeds else 0, "seed")
    return f"{_sentence_case(plural(len(scenes), 'scene'))}, {each} each."


def _untested(outcomes: Sequence[Outcome], main: Mapping[str, Survival]) -> Iterator[Point]:
    """Yield which attacks say nothing of the message, and which cells failed, with the reason."""
    missed = [spoken(row.variant) for row in main.values() if row.reached is False and row.variant != REFERENCE]
    if missed:
        text = f"{_sentence_case(listed(missed))} did not change anything that the extraction reads."
        yield "Did not touch it", f"{text} That the message is left says nothing of its strength."
    elif any(row.reached for row in main.values()):
        yield "All touched it", "Every attack changed something that the extraction reads."
    models = len({o.asset for o in outcomes})
    reasons = dict.fromkeys(o.failure for o in outcomes if o.failure)
    for reason in reasons:
        failed = [o for o in outcomes if o.failure == reason]
        names = listed(dict.fromkeys(spoken(o.variant) for o in failed))
        where = f"on {len({o.asset for o in failed})} of {plural(models, 'model')}"
        yield "Not possible", f"{_sentence_case(names)} {where}: {shorten(reason, _REASON, placeholder=' …')}"


def _sentence_case(text: str) -> str:
    return text[:1].upper() + text[1:]
