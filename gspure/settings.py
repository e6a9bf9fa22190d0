"""Settings of attacks and schemes: the keyword-only parameters of their functions.

A number is annotated with its bounds, such as ``fraction: Annotated[float, Range(0.0, 1.0)] = 0.25``.
"""

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from gspure.bounds import Range
from gspure.errors import InputError

Setting = float | int | str

_UNBOUNDED: Final = {int: Range(-(2**53), 2**53), float: Range(-1e30, 1e30)}
"""Bounds of numbers without an annotation, in plug-ins."""

LONGEST: Final = 1000  # characters of a text


def defaults(function: Callable[..., Any]) -> dict[str, Setting]:
    """Return the settings of a function and their defaults."""
    return {p.name: p.default for p in inspect.signature(function).parameters.values() if p.kind is p.KEYWORD_ONLY}


def bounds(function: Callable[..., Any]) -> dict[str, Range | None]:
    """Return the bounds of the settings of a function; None for a text."""
    try:
        parameters = inspect.signature(function, eval_str=True).parameters
    except NameError as error:
        expected = "types that are imported at run time, not only under TYPE_CHECKING"
        raise InputError(function.__module__, "annotations", expected=expected, found=str(error)) from None
    return {
        name: next((b for b in getattr(parameters[name].annotation, "__metadata__", ()) if isinstance(b, Range)), None)
        or _UNBOUNDED.get(type(default))
        for name, default in defaults(function).items()
    }


def parsed_settings(source: str, function: Callable[..., Any], texts: Mapping[str, str]) -> dict[str, Setting]:
    """Return settings from texts, numbers where the function takes numbers; refuse them as `require_settings` does."""
    known = bounds(function)
    settings: dict[str, Setting] = {**texts}
    for name in texts.keys() & known.keys():
        limits = known[name]
        if limits and (value := limits.parse(texts[name])) is not None:
            settings[name] = value
    require_settings(source, function, settings)
    return settings


def require_settings(
    source: str | Path, function: Callable[..., Any], settings: Mapping[str, object], place: str = ""
) -> None:
    """Raise `InputError` for a setting, at a `place` of a source, that is unknown, of another type or out of bounds."""
    known = bounds(function)
    for name, value in settings.items():
        field = f"{place}{name}"
        if name not in known:
            expected = f"one of {', '.join(known)}" if known else "no settings"
            raise InputError(source, field, expected=expected, found="an unknown key")
        if limits := known[name]:
            limits.require(source, field, value)
        elif not isinstance(value, str) or not value.strip() or len(value) > LONGEST:
            raise InputError(source, field, expected=f"a text of at most {LONGEST} characters", found=repr(value))
