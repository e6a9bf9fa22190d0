"""GSPure against every other attack, scene by scene: what it takes more or less, and how sure that is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from gspure.evaluation.matched import Sweeps, completed, drop_within
from gspure.evaluation.outcomes import REFERENCE, SCENE, Outcome, ordered
from gspure.evaluation.sheet import number, read_sheet, write_sheet
from gspure.evaluation.statistics import (
    MATCHED_DAMAGES,
    Cells,
    Interval,
    differences,
    holm,
    mean_interval,
    paired_test,
)

METHOD: Final = "gspure"
"""The variant that others are compared with, and the name of the sweep over its factors."""

SCORE, MESSAGE_DROP, SCENE_DROP = "score", "message_drop", "scene_drop"

QUANTITIES: Final = {SCORE: (-1, 1), MESSAGE_DROP: (0, 1), SCENE_DROP: (1, 0)}
"""What is compared, by how much of what scene and message lose it is made of."""

HEADER: Final = (
    *("scheme", "extraction", "rival", "quantity", "damage", "cells"),
    *(f"difference_{part}" for part in Interval._fields),
    *("p", "p_adjusted", "p_attainable"),
)


class Contest(NamedTuple):
    """GSPure less one rival, in one quantity."""

    scheme: str
    extraction: str
    """The target that shows the message."""

    rival: str
    """A variant; where `damage` is known, a sweep."""

    quantity: str
    """`SCORE`, `MESSAGE_DROP` or `SCENE_DROP`, in dB."""

    damage: float
    """What both may cost the scene, dB; NaN where they are compared as they were run."""

    cells: int
    """In how many scenes and seeds both are known."""

    difference: Interval
    """Positive where GSPure has more."""

    p: float = math.nan
    """Of the sign-flip test of the Score; NaN for other quantities."""

    adjusted: float = math.nan
    """`p` after Holm's correction for all rivals of this scheme and extraction."""

    attainable: float = math.nan
    """What `adjusted` could at best have been, with as many rivals and as few scenes."""


def contest(outcomes: Sequence[Outcome], sweeps: Sweeps) -> list[Contest]:
    """Compare GSPure with every other attack, for every scheme and extraction of the message.

    Controls and GSPure itself at other strengths are no rivals. Only the Score is tested: it is the measure that the
    paper names, and every further test makes the correction for all of them harsher. For the rest, intervals say how
    sure they are.

    Parameters
    ----------
    outcomes : sequence of Outcome
        In any order; schemes and rivals stay in it.
    sweeps : mapping
        Variants that are one attack at several strengths; others are sweeps of their own. The one named `METHOD` is
        compared with the others at `MATCHED_DAMAGES`.

    """
    found: list[Contest] = []
    own = {*sweeps.get(METHOD, ())} - {METHOD}
    for scheme in dict.fromkeys(o.scheme for o in outcomes):
        attacks = [o for o in outcomes if o.scheme == scheme and o.variant != REFERENCE and not o.is_control]
        for extraction in ordered({target for o in attacks for target in o.messages}):
            drops = _drops(attacks, extraction)
            for quantity, cells in _as_run({name: cells for name, cells in drops.items() if name not in own}).items():
                found += _against(cells, scheme, extraction, quantity, math.nan)
            for damage in MATCHED_DAMAGES:
                cells = _at_equal_damage(drops, completed(sweeps, drops), damage)
                found += _against(cells, scheme, extraction, MESSAGE_DROP, damage)
    return found


def write_contest(path: Path, rows: Iterable[Contest]) -> None:
    """Write one CSV row per rival and quantity; unknown numbers are empty."""
    write_sheet(path, HEADER, ([*row[:6], *row.difference, *row[7:]] for row in rows))


def read_contest(path: Path) -> list[Contest]:
    """Read what `write_contest` has written, or raise `InputError`."""
    return read_sheet(path, HEADER, "a table of GSPure against other attacks", _row)


Drops = Mapping[str, Mapping[tuple[str, int], tuple[float, float]]]
"""By variant, and by scene and seed: what scene and message lost, dB."""


def _drops(attacks: Sequence[Outcome], extraction: str) -> Drops:
    """Return what is known of both."""
    found: dict[str, dict[tuple[str, int], tuple[float, float]]] = {}
    for o in attacks:
        drops = (o.psnr_drop(SCENE), o.psnr_drop(extraction))
        if all(map(math.isfinite, drops)):
            found.setdefault(o.variant, {})[o.scene, o.seed] = drops
    return found


def _as_run(drops: Drops) -> dict[str, dict[str, Cells]]:
    """Return each quantity by variant."""
    return {
        quantity: {
            variant: {cell: of_scene * scene + of_message * message for cell, (scene, message) in cells.items()}
            for variant, cells in drops.items()
        }
        for quantity, (of_scene, of_message) in QUANTITIES.items()
    }


def _at_equal_damage(drops: Drops, sweeps: Sweeps, damage: float) -> dict[str, Cells]:
    """Return what each sweep takes from the message where the scene may lose `damage`."""
    found: dict[str, Cells] = {}
    for name, variants in sweeps.items():
        points: dict[tuple[str, int], list[tuple[float, float]]] = {}
        for variant in variants:
            for cell, both in drops.get(variant, {}).items():
                points.setdefault(cell, []).append(both)
        found[name] = {cell: drop_within(strengths, damage)[0] for cell, strengths in points.items()}
    return found


def _against(cells: Mapping[str, Cells], scheme: str, extraction: str, quantity: str, damage: float) -> list[Contest]:
    """Compare GSPure with all others that share a scene and seed with it."""
    ours = cells.get(METHOD, {})
    shared = {rival: differences(ours, theirs) for rival, theirs in cells.items() if rival != METHOD}
    by_rival = {rival: by_scene for rival, by_scene in shared.items() if by_scene}
    rows = [
        Contest(scheme, extraction, rival, quantity, damage, sum(map(len, by_scene)), mean_interval(by_scene))
        for rival, by_scene in by_rival.items()
    ]
    if quantity != SCORE:
        return rows
    tests = [paired_test(by_scene) for by_scene in by_rival.values()]
    adjusted, attainable = holm([test.p for test in tests]), holm([test.smallest_p for test in tests])
    return [
        row._replace(p=test.p, adjusted=float(p), attainable=float(best))
        for row, test, p, best in zip(rows, tests, adjusted, attainable, strict=True)
    ]


def _row(scheme: str, extraction: str, rival: str, quantity: str, damage: str, cells: str, *numbers: str) -> Contest:
    mean, low, high, level, scenes, *tested = map(number, numbers)
    difference = Interval(mean, low, high, level, int(scenes))
    return Contest(scheme, extraction, rival, quantity, number(damage), int(cells), difference, *tested)
