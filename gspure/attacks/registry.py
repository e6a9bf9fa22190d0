"""All attacks by name: the built-in ones, and those that installed packages offer in the group ``gspure.attacks``."""

from __future__ import annotations

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
from gspure.plugins import offered

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
    return offered(GROUP, Attack, BUILT_IN, _require_evidence)


def find_attack(name: str) -> Attack:
    """Return the attack of this name, or raise `InputError` listing those there are."""
    known = attacks()
    if name not in known:
        raise InputError("attack", "name", expected=f"one of {', '.join(known)}", found=repr(name))
    return known[name]


def _require_evidence(attack: Attack, source: str) -> None:
    """Refuse an attack that needs what nobody measures."""
    if not attack.needs <= EVIDENCE:
        needs = ", ".join(sorted(attack.needs))
        raise InputError(source, "needs", expected=f"of {', '.join(sorted(EVIDENCE))}", found=needs)
