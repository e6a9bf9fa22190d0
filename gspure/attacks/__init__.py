"""Attacks by name: the built-in ones, and those of installed plug-ins; pure functions of a public model."""

from gspure.attacks import (
    collusion,
    compression,
    geometry,
    learning,
    marks,
    pruning,
    renders,
    resampling,
    symmetries,
    values,
    warping,
)
from gspure.attacks.attack import MEASUREMENTS, PUBLIC, Attack, Measurements
from gspure.attacks.attacked import Attacked, NotApplicable, affected
from gspure.attacks.strength import Strength
from gspure.errors import InputError
from gspure.plugins import registered

__all__ = [
    "BUILT_IN",
    "Attack",
    "Attacked",
    "Measurements",
    "NotApplicable",
    "Strength",
    "affected",
    "attacks",
    "find_attack",
]

BUILT_IN = (
    *pruning.ATTACKS,
    *values.ATTACKS,
    *compression.ATTACKS,
    *geometry.ATTACKS,
    *warping.ATTACKS,
    *resampling.ATTACKS,
    *symmetries.ATTACKS,
    *learning.ATTACKS,
    *marks.ATTACKS,
    *collusion.ATTACKS,
    *renders.ATTACKS,
)


def attacks() -> dict[str, Attack]:
    """Return every attack by name.

    Raise `InputError` if a plug-in cannot be imported, is not an `Attack`, or takes a name that is already in use.
    """
    return registered("attacks", Attack, BUILT_IN, _require_known)


def find_attack(name: str) -> Attack:
    """Return the attack of this name, or raise `InputError` with the known ones.

    >>> attacked = gspure.find_attack("random_pruning").apply(model, seed=1, fraction=0.25)
    >>> len(attacked.model), int(attacked.prune_mask.sum())
    (300, 100)
    """
    known = attacks()
    if name not in known:
        raise InputError("attack", "name", expected=f"one of {', '.join(known)}", found=repr(name))
    return known[name]


def _require_known(attack: Attack, source: str) -> None:
    """Refuse an attack with a parameter that nothing measures."""
    known = MEASUREMENTS | PUBLIC
    if not attack.parameters <= known:
        needs = ", ".join(sorted(attack.parameters))
        raise InputError(source, "needs", expected=f"none but {', '.join(sorted(known))}", found=needs)
