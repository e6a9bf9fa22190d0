"""Settings of commands, attacks and schemes, with the range of each.

Options of commands take a `Range`. Settings of attacks and schemes are the keyword-only parameters of their functions,
annotated with one, such as ``fraction: Annotated[float, Range(0.0, 1.0)] = 0.25``. The schema of the configuration
repeats the same numbers. The upper ends are far above useful values.
"""

import inspect
from collections.abc import Callable, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

from gspure.errors import InputError

Setting = float | int | str


class Range(NamedTuple):
    """Numbers from `least` to `most`: integers if `least` is an int; without `least` itself if `above`."""

    least: float
    most: float
    above: bool = False

    @property
    def kind(self) -> type[int] | type[float]:
        """The type of the numbers."""
        return int if isinstance(self.least, int) else float

    def __str__(self) -> str:
        least = _plain(self.least)
        most = _plain(self.most)
        return f"above {least}, at most {most}" if self.above else f"{least} to {most}"

    @property
    def expected(self) -> str:
        """The range in words, for errors."""
        noun = "a whole number" if self.kind is int else "a number"
        return f"{noun} {self}" if self.above else f"{noun} from {self}"

    def __contains__(self, value: Any) -> bool:
        is_number = isinstance(value, Integral if self.kind is int else Real) and not isinstance(value, bool)
        return is_number and bool(self.least <= value <= self.most) and not (self.above and value == self.least)

    def require(self, source: str | Path, field: str, value: object) -> None:
        """Raise `InputError` for the `field` of a source unless its value is in the range."""
        if value not in self:
            text = repr(value) if isinstance(value, str) else str(value)
            raise InputError(source, field, expected=self.expected, found=text)

    def parse(self, text: str) -> float | None:
        """Return the number of a text; None if it is no number in the range."""
        try:
            value = self.kind(text)
        except ValueError:  # no number, or too many digits
            return None
        return value if value in self else None


def _plain(number: float) -> str:
    return f"{number:d}" if isinstance(number, int) else f"{number:.12g}"


SHARE: Final = Range(0.0, 1.0)
FACTOR: Final = Range(0.0, 1e6, above=True)
AMOUNT: Final = Range(0.0, 1e6)
COORDINATE: Final = Range(-1e9, 1e9)
SEED: Final = Range(0, 2**32 - 1)
STEPS: Final = Range(1, 1_000_000)  # of training
CLUSTER_SHARE: Final = Range(0.0, 1.0, above=True)
CLUSTER_SIZE: Final = Range(2, 100_000_000)
NEIGHBOURS: Final = Range(1, 128)  # the kernels store so many for each of millions of points
DECIBELS: Final = Range(0.0, 100.0, above=True)
FIELD_OF_VIEW: Final = Range(5.0, 179.0)  # degrees
TRACED_SIDE: Final = Range(16, 16384)  # of a ray-traced image, in pixels
PAIR_VIEWS: Final = Range(3, 10_000)  # of two views, one is held out, and a single training view fixes no positions
SECONDS: Final = Range(0.0, 1e6, above=True)
CORES: Final = Range(1, 10_000)
MAX_GAUSSIANS: Final = Range(4, 100_000_000)  # at the end of training, which starts from at least 4
VIEWS: Final = Range(1, 10_000)
SIDE: Final = Range(1, 65535)  # of an image, in pixels

Share = Annotated[float, SHARE]
Factor = Annotated[float, FACTOR]
Amount = Annotated[float, AMOUNT]
Steps = Annotated[int, STEPS]
MaxGaussians = Annotated[int, MAX_GAUSSIANS]

SCHEDULES: Final = ("vanilla", "fast")  # of training: 3DGS's, or ours for half the time

_UNBOUNDED: Final = {int: Range(-(2**53), 2**53), float: Range(-1e30, 1e30)}
"""Bounds of the numbers of plug-ins that do not annotate them."""

_LONGEST_TEXT: Final = 1000  # characters of a text


def defaults(function: Callable[..., Any]) -> dict[str, Setting]:
    """Return the settings of a function and their defaults."""
    parameters = inspect.signature(function).parameters.values()
    return {parameter.name: parameter.default for parameter in parameters if parameter.kind is parameter.KEYWORD_ONLY}


def bounds(function: Callable[..., Any]) -> dict[str, Range | None]:
    """Return the bounds of the settings of a function; None for a text."""
    parameters = inspect.signature(function, eval_str=True).parameters
    limits: dict[str, Range | None] = {}
    for name, default in defaults(function).items():
        metadata = getattr(parameters[name].annotation, "__metadata__", ())
        ranges = (item for item in metadata if isinstance(item, Range))
        limits[name] = next(ranges, _UNBOUNDED.get(type(default)))
    return limits


def typed_settings(function: Callable[..., Any], settings: Mapping[str, Setting]) -> dict[str, Setting]:
    """Return settings in which whole numbers are floats where the function takes floats: 30.0, not 30."""
    known = bounds(function)
    typed = dict(settings)
    for name, value in settings.items():
        limits = known.get(name)
        if limits is not None and isinstance(value, int):
            typed[name] = limits.kind(value)
    return typed


def parsed_settings(source: str, function: Callable[..., Any], texts: Mapping[str, str]) -> dict[str, Setting]:
    """Return settings parsed from texts, numbers where the function takes them; refuse as `require_settings` does."""
    known = bounds(function)
    settings: dict[str, Setting] = {**texts}
    for name in texts.keys() & known.keys():
        limits = known[name]
        value = limits.parse(texts[name]) if limits else None
        if value is not None:
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
        limits = known[name]
        if limits:
            limits.require(source, field, value)
        elif not isinstance(value, str) or not value.strip() or len(value) > _LONGEST_TEXT:
            raise InputError(source, field, expected=f"a text of at most {_LONGEST_TEXT} characters", found=repr(value))
