"""All attacks by name: the built-in ones, and those that installed packages offer in the group ``gspure.attacks``."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

from gspure.attacks import (
    compression,
    crop,
    densify_clone,
    feature_scaling,
    gaussian_noise,
    gof,
    gspure,
    inject,
    lowest_opacity,
    lowest_opacity_matched,
    lowest_weight,
    lowest_weight_matched,
    opacity_noise,
    opacity_weight,
    plain_opacity,
    plain_weight,
    position_noise,
    quantize,
    random_matched,
    random_pruning,
    reorder,
    rigid_transform,
    sh_truncation,
    watermarked,
)
from gspure.attacks.attack import EVIDENCE, Attack
from gspure.errors import InputError

BUILT_IN = (
    watermarked.ATTACK,
    gspure.ATTACK,
    random_pruning.ATTACK,
    feature_scaling.ATTACK,
    gaussian_noise.ATTACK,
    gof.ATTACK,
    plain_weight.ATTACK,
    plain_opacity.ATTACK,
    opacity_weight.ATTACK,
    random_matched.ATTACK,
    lowest_weight_matched.ATTACK,
    lowest_opacity_matched.ATTACK,
    lowest_weight.ATTACK,
    lowest_opacity.ATTACK,
    opacity_noise.ATTACK,
    position_noise.ATTACK,
    quantize.ATTACK,
    sh_truncation.ATTACK,
    compression.ATTACK,
    crop.ATTACK,
    densify_clone.ATTACK,
    inject.ATTACK,
    reorder.ATTACK,
    rigid_transform.ATTACK,
)
GROUP = "gspure.attacks"


def attacks() -> dict[str, Attack]:
    """Return every attack by name.

    Raises
    ------
    InputError
        If a plug-in cannot be imported, is not an `Attack`, or takes a name that is already in use.

    """
    found = {attack.name: attack for attack in BUILT_IN}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        attack = _load(entry)
        if attack.name in found:
            raise InputError(_source(entry), "name", expected="a name not in use", found=repr(attack.name))
        found[attack.name] = attack
    return found


def find_attack(name: str) -> Attack:
    """Return the attack of this name, or raise `InputError` listing those there are."""
    known = attacks()
    if name not in known:
        raise InputError("attack", "name", expected=f"one of {', '.join(known)}", found=repr(name))
    return known[name]


def _load(entry: EntryPoint) -> Attack:
    try:
        attack = entry.load()
    except Exception as error:  # whatever a foreign module raises, say whose it is
        message = f"{type(error).__name__}: {error}"
        raise InputError(_source(entry), entry.value, expected="an importable attack", found=message) from error
    if not isinstance(attack, Attack):
        raise InputError(_source(entry), entry.value, expected="a gspure.attacks.Attack", found=type(attack).__name__)
    if not attack.needs <= EVIDENCE:
        needs = ", ".join(sorted(attack.needs))
        raise InputError(_source(entry), "needs", expected=f"of {', '.join(sorted(EVIDENCE))}", found=needs)
    return attack


def _source(entry: EntryPoint) -> str:
    package = entry.dist.name if entry.dist else "unknown package"
    return f"{package} (entry point {entry.name!r} of {GROUP})"
