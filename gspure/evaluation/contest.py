"""GSPure minus every other attack, in the same scenes and seeds, with the significance of each difference."""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Final, Literal, NamedTuple

from gspure.evaluation.matched import Curves, Point, Sweeps, completed, curves, damages, points
from gspure.evaluation.identity import Condition, OfCondition
from gspure.evaluation.outcomes import Outcome, by_condition, extractions
from gspure.evaluation.paper import ATTACKS as PAPER_ATTACKS
from gspure.metrics.names import GSPURE, UNATTACKED
from gspure.metrics.statistics import Cells, Interval, by_scene, differences, holm, mean_interval, means_of, paired_test
from gspure.metrics.targets import is_picture

Quantity = Literal["score", "message_drop", "scene_drop"]
SCORE: Final = "score"
MESSAGE_DROP: Final = "message_drop"
SCENE_DROP: Final = "scene_drop"

WEIGHTS: Final[Mapping[Quantity, tuple[int, int]]] = {SCORE: (-1, 1), MESSAGE_DROP: (0, 1), SCENE_DROP: (1, 0)}
"""Each quantity as a weighted sum of the drops of scene and message."""


class Contest(NamedTuple):
    """GSPure minus one other attack, in one quantity."""

    condition: OfCondition
    extraction: str  # the target that shows the message
    attack: str  # a variant; where `damage` is known, a sweep
    quantity: Quantity
    damage: float  # permitted drop of the scene's PSNR, dB; NaN if both are compared as they were run
    cells: int  # number of scenes and seeds in which both are known
    difference: Interval  # dB; positive where GSPure has more
    p: float = math.nan  # of the sign-flip test of the Score; NaN for other quantities
    p_adjusted: float = math.nan  # `p` after Holm's correction for all attacks on this condition and extraction
    p_attainable: float = math.nan  # the smallest `p_adjusted` possible with this number of attacks and scenes


def contest(outcomes: Sequence[Outcome], sweeps: Sweeps) -> list[Contest]:
    """Compare GSPure with every other attack, for every condition and extraction of the message, in their order.

    Controls, and GSPure itself at other strengths, are left out. Only the Score is tested. `sweeps` name variants that
    are one attack at several strengths; that named `GSPURE` is compared with the others at equal `damages`.
    """
    rows: list[Contest] = []
    other_strengths = {*sweeps.get(GSPURE, ())} - {GSPURE}
    for condition, alike in by_condition(outcomes).items():
        attacks = [o for o in alike if o.variant != UNATTACKED and not o.is_control]
        for extraction in extractions(attacks):
            known = curves(attacks, extraction)
            variants = dict.fromkeys(variant for curve in known.values() for variant in curve)
            as_run = [name for name in variants if name not in other_strengths]
            for quantity in WEIGHTS if is_picture(extraction) else (MESSAGE_DROP, SCENE_DROP):
                of_scene, of_message = WEIGHTS[quantity]
                cells = {
                    name: {
                        cell: of_scene * c[name][0] + of_message * c[name][1] for cell, c in known.items() if name in c
                    }
                    for name in as_run
                }
                rows += _against(cells, condition, extraction, quantity)
            for damage in damages(o.variant for o in attacks):
                cells = {
                    name: {
                        cell: at.message for cell, at in points(known, of, damage).items() if at and at.scene == damage
                    }
                    for name, of in completed(sweeps, variants).items()
                }
                rows += _against(cells, condition, extraction, MESSAGE_DROP, damage)
    return rows


class Lead(NamedTuple):
    """GSPure minus the best other attack, in the drop of the message, at most a certain damage to the scene."""

    condition: OfCondition
    extraction: str
    damage: float  # largest drop of the scene's PSNR, dB
    against: str  # `all` other attacks, or those of the `paper`
    attack: str  # the best of them: that of the smallest mean difference
    is_bound: bool  # whether it does less damage than permitted somewhere: then the difference is an upper bound
    difference: Interval  # dB, over the scenes in which both do at most this damage


def leads(outcomes: Sequence[Outcome], attacks: Sweeps) -> list[Lead]:
    """Compare GSPure with the best other attack at each of the `damages`, for every condition and extraction.

    An attack counts in the scenes that it costs at most the damage, and competes if these are half of GSPure's or more.
    """
    rows = []
    for condition, alike in by_condition(outcomes).items():
        attacked = [o for o in alike if o.variant != UNATTACKED and not o.is_control]
        for extraction, damage in product(extractions(attacked), damages(o.variant for o in attacked)):
            known = curves(attacked, extraction)
            reached = {name: _within(known, variants, damage) for name, variants in attacks.items()}
            messages = {name: {cell: at.message for cell, at in of.items()} for name, of in reached.items()}
            ours = messages.pop(GSPURE, {})
            shared = {name: by_scene(differences(ours, theirs)) for name, theirs in messages.items()}
            rivals = {name: of for name, of in shared.items() if of and 2 * len(of) >= len(by_scene(ours))}
            for against, names in (("all", rivals), ("paper", [name for name in rivals if name in PAPER_ATTACKS])):
                if names:
                    best = min(names, key=lambda name, of=rivals: means_of(of[name]).mean())
                    is_bound = any(reached[best][cell].scene < damage for cell in ours.keys() & reached[best].keys())
                    difference = mean_interval(rivals[best])
                    rows.append(Lead(condition, extraction, damage, against, best, is_bound, difference))
    return rows


def _within(known: Curves, sweep: Sequence[str], damage: float) -> dict[tuple[str, int], Point]:
    """Return the points of a sweep that do at most a damage, those of gentler strengths where a search missed it."""
    gentle = {cell: {name: at for name, at in curve.items() if at[0] <= damage} for cell, curve in known.items()}
    every = [*points(gentle, sweep, damage).items(), *points(known, sweep, damage).items()]
    return {cell: point for cell, point in every if point and point.scene <= damage}


def _against(
    cells: Mapping[str, Cells], condition: Condition, extraction: str, quantity: Quantity, damage: float = math.nan
) -> list[Contest]:
    """Compare GSPure with every other attack that shares a scene and seed with it."""
    gspure = cells.get(GSPURE, {})
    shared = {attack: by_scene(differences(gspure, known)) for attack, known in cells.items() if attack != GSPURE}
    by_attack = {attack: scenes for attack, scenes in shared.items() if scenes}
    rows = [
        Contest(condition, extraction, attack, quantity, damage, sum(map(len, scenes)), mean_interval(scenes))
        for attack, scenes in by_attack.items()
    ]
    if quantity != SCORE:
        return rows
    tests = [paired_test(scenes) for scenes in by_attack.values()]
    adjusted, attainable = holm([test.p for test in tests]), holm([test.smallest_p for test in tests])
    return [
        row._replace(p=test.p, p_adjusted=float(p), p_attainable=float(best))
        for row, test, p, best in zip(rows, tests, adjusted, attainable, strict=True)
    ]
