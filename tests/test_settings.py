"""Settings: every number of an attack or a scheme has bounds, which admit its default."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from gspure import settings as bounds
from gspure.attacks.registry import attacks
from gspure.errors import InputError
from gspure.schemes.registry import schemes
from gspure.settings import Range, defaults, parsed_settings, require_settings
from gspure.settings import bounds as bounds_of

NO_NUMBERS = ("", " ", "0x10", "1_0", " 1", "1\n", "١", "½", "--", "1,5", "None")
VALUES = (-1, 0, math.nan, math.inf, 10**9, 10**30, 10**400, 1e30, True, None, "", " ", "1", "1e3", "١", [], {})


def outcome(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a function returns, or its refusal."""
    try:
        return function(*arguments)
    except InputError as error:
        return error


FUNCTIONS = {f"attack {a.name}": a.function for a in attacks().values()}
FUNCTIONS |= {f"scheme {s.name}": s.embed for s in schemes().values()}
SETTINGS = {
    f"{name} {setting}": (function, setting) for name, function in FUNCTIONS.items() for setting in defaults(function)
}


@pytest.mark.parametrize("name", SETTINGS)
def test_every_number_of_attacks_and_schemes_has_bounds_that_admit_its_default(name):
    function, setting = SETTINGS[name]
    default, limits = defaults(function)[setting], bounds_of(function)[setting]
    if isinstance(default, str):
        assert limits is None
    else:
        assert default in limits
        assert -1e9 < limits.least < limits.most < 1e9
        assert limits.kind is type(default)


@pytest.mark.parametrize("name", SETTINGS)
def test_settings_out_of_bounds_are_refused(name):
    function, setting = SETTINGS[name]
    limits = bounds_of(function)[setting]
    for value in VALUES:
        refusal = outcome(require_settings, "test", function, {setting: value})
        is_accepted = value in limits if limits else isinstance(value, str) and bool(value.strip())
        assert (refusal is None) == is_accepted
        assert is_accepted or refusal.field == setting
    for word in NO_NUMBERS if limits else ("", " "):
        with pytest.raises(InputError):
            parsed_settings("test", function, {setting: word})


def test_bounds_in_annotations_that_are_texts_are_read():
    def attack(*, share: bounds.Share = 0.5) -> None: ...  # this module's annotations are texts

    assert bounds_of(attack) == {"share": bounds.SHARE}


@pytest.mark.parametrize("value", [1, 10, 5.5])
def test_a_range_includes_its_ends_and_only_whole_numbers_if_they_are(value):
    assert (value in Range(1, 10)) == isinstance(value, int)
    assert value in Range(1.0, 10.0)
    assert 1.0 not in Range(1.0, 10.0, above=True)
