"""Surface-aware purification, the paper's baseline GOF: what lies off the surface goes."""

from __future__ import annotations

from typing import Final

from gspure.attacks.attack import Attack, Attacked, Distances, Rng
from gspure.attacks.settings import require_size
from gspure.model.gaussians import Gaussians

TOLERANCE: Final = 3.0
"""Scales from the surface. Ours: the paper does not say how GOF, a method of reconstruction, decides what to remove."""


def gof(model: Gaussians, _rng: Rng, surface: Distances, *, tolerance: float = TOLERANCE) -> Attacked:
    """Keep the rows within `tolerance` of their own scales of the surface that the views see."""
    require_size("gof", "tolerance", tolerance)
    return Attacked.pruned(model, surface <= tolerance)


ATTACK = Attack("gof", gof)
