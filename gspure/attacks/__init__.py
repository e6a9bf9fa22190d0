"""Attacks: pure functions from a public model to an attacked one, the built-in ones and those of other packages."""

from gspure.attacks.attack import Attack, Measurements
from gspure.attacks.attacked import Attacked, NotApplicable, affected
from gspure.attacks.registry import attacks, find_attack
from gspure.attacks.strength import Strength

__all__ = ["Attack", "Attacked", "Measurements", "NotApplicable", "Strength", "affected", "attacks", "find_attack"]
