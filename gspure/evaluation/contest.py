"""GSPure minus every other attack, in the same scenes and seeds, with the significance of each difference."""

import math
from collections.abc import Mapping, Sequence
from typing import Final, Literal, NamedTuple

from gspure.evaluation.intervals import Cells, Interval, by_scene, differences, mean_interval
from gspure.evaluation.matched import Drops, Point, Sweeps, completed, curves, damages
from gspure.evaluation.names import GSPURE, UNATTACKED
from gspure.evaluation.outcomes import SCENE, Condition, Outcome, by_condition, is_picture, ordered
from gspure.evaluation.significance import holm, paired_test

Quantity = Literal["score", "message_drop", "scene_drop"]
SCORE: Final = "score"
MESSAGE_DROP: Final = "message_drop"
SCENE_DROP: Final = "scene_drop"

WEIGHTS: Final[Mapping[Quantity, tuple[int, int]]] = {SCORE: (-1, 1), MESSAGE_DROP: (0, 1), SCENE_DROP: (1, 0)}
"""Each quantity as a weighted sum of the drops of scene and message."""

DropsByVariant = Mapping[str, Mapping[tuple[str, int], Drops]]  # drops by variant, and by scene and seed


class Contest(NamedTuple):
    """GSPure minus one other attack, in one quantity."""

    scheme: str
    protocol: str
    initialization: str
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

    Controls, and GSPure itself at other strengths, are left out. Only the Score is tested: it is the measure that the
    paper names, and further tests would make the correction harsher. Other quantities have intervals alone.

    `sweeps` name variants that are one attack at several strengths; others are sweeps of one strength. The sweep named
    `GSPURE` is compared with the others at equal `gspure.evaluation.matched.damages`.
    """
    rows: list[Contest] = []
    other_strengths = {*sweeps.get(GSPURE, ())} - {GSPURE}
    for condition, alike in by_condition(outcomes).items():
        attacks = [o for o in alike if o.variant != UNATTACKED and not o.is_control]
        for extraction in ordered({target for o in attacks for target in o.messages}):
            drops = _drops(attacks, extraction)
            as_run = {name: cells for name, cells in drops.items() if name not in other_strengths}
            for quantity in WEIGHTS if is_picture(extraction) else (MESSAGE_DROP, SCENE_DROP):
                rows += _against(_as_run(as_run, quantity), condition, extraction, quantity, math.nan)
            for damage in damages(o.variant for o in attacks):
                cells = _at_equal_damage(attacks, extraction, completed(sweeps, drops), damage)
                rows += _against(cells, condition, extraction, MESSAGE_DROP, damage)
    return rows


def _drops(attacks: Sequence[Outcome], extraction: str) -> DropsByVariant:
    """Return the drops of every attack where both are known."""
    by_variant: dict[str, dict[tuple[str, int], Drops]] = {}
    for o in attacks:
        drops = (o.psnr_drop(SCENE), o.drop(extraction))
        if all(map(math.isfinite, drops)):
            by_variant.setdefault(o.variant, {})[o.scene, o.seed] = drops
    return by_variant


def _as_run(drops: DropsByVariant, quantity: Quantity) -> dict[str, Cells]:
    """Return a quantity by variant."""
    of_scene, of_message = WEIGHTS[quantity]
    return {
        variant: {cell: of_scene * scene + of_message * message for cell, (scene, message) in cells.items()}
        for variant, cells in drops.items()
    }


def _at_equal_damage(attacks: Sequence[Outcome], extraction: str, sweeps: Sweeps, damage: float) -> dict[str, Cells]:
    """Return the message's drop by sweep at a permitted drop of the scene, in the models that it damages so much."""
    by_sweep = {name: curves([o for o in attacks if o.variant in of], extraction) for name, of in sweeps.items()}
    points = {name: {cell: Point.at(damage, c) for cell, c in known.items()} for name, known in by_sweep.items()}
    return {
        name: {cell: point.message for cell, point in cells.items() if point and point.scene == damage}
        for name, cells in points.items()
    }


def _against(
    cells: Mapping[str, Cells], condition: Condition, extraction: str, quantity: Quantity, damage: float
) -> list[Contest]:
    """Compare GSPure with every other attack that shares a scene and seed with it."""
    gspure = cells.get(GSPURE, {})
    shared = {attack: by_scene(differences(gspure, known)) for attack, known in cells.items() if attack != GSPURE}
    by_attack = {attack: scenes for attack, scenes in shared.items() if scenes}
    rows = [
        Contest(*condition, extraction, attack, quantity, damage, sum(map(len, scenes)), mean_interval(scenes))
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
