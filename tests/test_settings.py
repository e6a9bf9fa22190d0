"""Settings: every number of an attack or a scheme has bounds, which admit its default."""

import math
from typing import Annotated

import pytest

from gspure.attacks import attacks
from gspure.errors import InputError
from gspure.schemes.registry import schemes
from gspure.settings import Range, bounds, defaults, parsed_settings, require_settings, typed_settings

WRONG = (math.nan, math.inf, 10**30, True, None, "1", [])
NO_NUMBERS = ("", " ", "0x10", "½", "1,5", "nan", "1e400")

FUNCTIONS = {f"attack {a.name}": a.function for a in attacks().values()}
FUNCTIONS |= {f"scheme {s.name}": s.embed for s in schemes().values()}
SETTINGS = {
    f"{name} {setting}": (function, setting) for name, function in FUNCTIONS.items() for setting in defaults(function)
}


@pytest.mark.parametrize("name", SETTINGS)
def test_every_number_of_attacks_and_schemes_has_bounds_that_admit_its_default(name):
    function, setting = SETTINGS[name]
    default = defaults(function)[setting]
    limits = bounds(function)[setting]
    if isinstance(default, str):
        assert limits is None
    else:
        assert default in limits
        assert -1e9 < limits.least < limits.most < 1e9
        assert limits.kind is type(default)


@pytest.mark.parametrize("name", ["attack quantize bits", "attack plain_weight tau"])
def test_values_out_of_bounds_and_of_other_types_are_refused(name):
    function, setting = SETTINGS[name]
    limits = bounds(function)[setting]
    require_settings("test", function, {setting: limits.least + 1})
    for value in (*WRONG, limits.least - 1, limits.most + 1):
        with pytest.raises(InputError):
            require_settings("test", function, {setting: value})
    for word in NO_NUMBERS:
        with pytest.raises(InputError):
            parsed_settings("test", function, {setting: word})


def test_whole_numbers_are_floats_where_a_function_takes_floats() -> None:
    def turn(*, angle: Annotated[float, Range(0.0, 360.0)] = 90.0, steps: int = 1, axis: str = "z") -> None:
        del angle, steps, axis

    settings = typed_settings(turn, {"angle": 30, "steps": 2, "axis": "x"})
    assert repr(settings) == "{'angle': 30.0, 'steps': 2, 'axis': 'x'}"
