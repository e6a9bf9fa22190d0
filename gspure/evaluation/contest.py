"""GSPure minus every other attack, in the same scenes and seeds, with the significance of each difference."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Final, Literal, NamedTuple

from gspure.evaluation.identity import Condition, OfCondition
from gspure.evaluation.matched import Curves, Point, Sweeps, completed, curves, damages, points
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
"""The weights of the drops of scene and message in each quantity, their weighted sum."""


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

    Controls, and GSPure itself at other strengths, are left out. Only the Score is tested. `sweeps` name the variants
    of one attack at several strengths; the sweep `GSPURE` is compared with the others at equal `damages`.
    """
    rows: list[Contest] = []
    other_strengths = {*sweeps.get(GSPURE, ())} - {GSPURE}
    for condition, alike in by_condition(outcomes).items():
        attacked = [o for o in alike if o.variant != UNATTACKED and not o.is_control]
        for extraction in extractions(attacked):
            known = curves(attacked, extraction)
            variants = dict.fromkeys(variant for curve in known.values() for variant in curve)
            as_run = [variant for variant in variants if variant not in other_strengths]
            for quantity in WEIGHTS if is_picture(extraction) else (MESSAGE_DROP, SCENE_DROP):
                cells = {variant: _quantity_of(known, variant, quantity) for variant in as_run}
                rows += _against(cells, condition, extraction, quantity)
            for damage in damages(attacked):
                cells = {name: _at_damage(known, sweep, damage) for name, sweep in completed(sweeps, variants).items()}
                rows += _against(cells, condition, extraction, MESSAGE_DROP, damage)
    return rows


def _quantity_of(known: Curves, variant: str, quantity: Quantity) -> Cells:
    """Return a quantity of one variant by scene and seed."""
    scene_weight, message_weight = WEIGHTS[quantity]
    values = {}
    for cell, curve in known.items():
        if variant in curve:
            drops = curve[variant]
            values[cell] = scene_weight * drops.scene + message_weight * drops.message
    return values


def _at_damage(known: Curves, sweep: Sequence[str], damage: float) -> Cells:
    """Return the drop of the message where a sweep does exactly this damage, by scene and seed."""
    at_damage = points(known, sweep, damage)
    return {cell: point.message for cell, point in at_damage.items() if point and point.scene == damage}


class Lead(NamedTuple):
    """GSPure minus the best other attack, in the drop of the message, at most a certain damage to the scene."""

    condition: OfCondition
    extraction: str
    damage: float  # largest drop of the scene's PSNR, dB
    against: str  # `all` other attacks, or those of the `paper`
    attack: str  # the best of them: GSPure minus this attack is smallest on average
    is_bound: bool  # whether it does less damage than permitted in some scene: `difference` is then an upper bound
    difference: Interval  # dB, over the scenes in which both do at most this damage


def leads(outcomes: Sequence[Outcome], attacks: Sweeps) -> list[Lead]:
    """Compare GSPure with the best other attack at each of the `damages`, for every condition and extraction.

    An attack counts in the scenes that it does at most this damage to. It competes if these are at least half as many
    as GSPure's.
    """
    rows = []
    for condition, alike in by_condition(outcomes).items():
        attacked = [o for o in alike if o.variant != UNATTACKED and not o.is_control]
        for extraction, damage in product(extractions(attacked), damages(attacked)):
            known = curves(attacked, extraction)
            within = {attack: _within(known, variants, damage) for attack, variants in attacks.items()}
            rows += [Lead(condition, extraction, damage, *fields) for fields in _best_rivals(within, damage)]
    return rows


def _best_rivals(
    within: Mapping[str, Mapping[tuple[str, int], Point]], damage: float
) -> Iterator[tuple[str, str, bool, Interval]]:
    """Yield the fields `against`, `attack`, `is_bound` and `difference` of `Lead`, from the points of each attack."""
    drops = {attack: {cell: point.message for cell, point in cells.items()} for attack, cells in within.items()}
    gspure = drops.pop(GSPURE, {})
    rivals = {}
    for attack, known in drops.items():
        shared = by_scene(differences(gspure, known))
        if shared and 2 * len(shared) >= len(by_scene(gspure)):
            rivals[attack] = shared
    rivals_of_paper = [attack for attack in rivals if attack in PAPER_ATTACKS]
    for against, attacks in (("all", [*rivals]), ("paper", rivals_of_paper)):
        if attacks:
            best = min(attacks, key=lambda attack: means_of(rivals[attack]).mean())
            is_bound = any(within[best][cell].scene < damage for cell in gspure.keys() & within[best].keys())
            yield against, best, is_bound, mean_interval(rivals[best])


def _within(known: Curves, sweep: Sequence[str], damage: float) -> dict[tuple[str, int], Point]:
    """Return the points of a sweep with at most this damage; a gentler strength replaces one whose search missed it."""
    gentle = {
        cell: {variant: drops for variant, drops in curve.items() if drops.scene <= damage}
        for cell, curve in known.items()
    }
    within: dict[tuple[str, int], Point] = {}
    for tried in (gentle, known):  # a point of all strengths replaces one of gentler strengths
        at_damage = points(tried, sweep, damage)
        within |= {cell: point for cell, point in at_damage.items() if point and point.scene <= damage}
    return within


def _against(
    cells: Mapping[str, Cells], condition: Condition, extraction: str, quantity: Quantity, damage: float = math.nan
) -> list[Contest]:
    """Compare GSPure with every other attack that shares a scene and seed with it; `cells` hold the quantity."""
    gspure = cells.get(GSPURE, {})
    by_attack = {}
    for attack, known in cells.items():
        shared = by_scene(differences(gspure, known))
        if attack != GSPURE and shared:
            by_attack[attack] = shared
    rows = [
        Contest(condition, extraction, attack, quantity, damage, sum(map(len, scenes)), mean_interval(scenes))
        for attack, scenes in by_attack.items()
    ]
    if quantity != SCORE:
        return rows
    tests = [paired_test(scenes) for scenes in by_attack.values()]
    adjusted = holm([test.p for test in tests])
    attainable = holm([test.smallest_p for test in tests])
    return [
        row._replace(p=test.p, p_adjusted=float(p), p_attainable=float(smallest))
        for row, test, p, smallest in zip(rows, tests, adjusted, attainable, strict=True)
    ]
