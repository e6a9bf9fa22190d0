"""Checks of settings, each refused in one line."""

from __future__ import annotations

import math

from gspure.errors import InputError


def require(attack: str, setting: str, value: object, expected: str, *, fits: bool) -> None:
    """Refuse a setting that does not fit.

    Raises
    ------
    InputError
        Naming the attack, the setting, what would fit, and the value.

    """
    if not fits:
        raise InputError(f"attack {attack}", setting, expected=expected, found=str(value))


def require_share(attack: str, setting: str, value: float) -> None:
    """Refuse what is not 0 to 1."""
    require(attack, setting, value, "0 to 1", fits=0 <= value <= 1)


def require_size(attack: str, setting: str, value: float) -> None:
    """Refuse what is negative or no number."""
    require(attack, setting, value, "a number of at least 0", fits=0 <= value < math.inf)
