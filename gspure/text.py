"""Numbers and facts as people read them."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from html import escape
from math import isinf, isnan
from typing import Final

UNKNOWN: Final = "–"
_LONG: Final = 1e6  # numbers from here on have an exponent


def decimal(value: float, decimals: int = 2) -> str:
    """Return a number with a fixed number of decimals and a true minus sign; zero has no sign, – is unknown."""
    if isnan(value):
        return UNKNOWN
    if isinf(value):
        return "∞" if value > 0 else "−∞"
    return f"{value:z.{decimals}{'f' if abs(value) < _LONG else 'e'}}".replace("-", "−")


def signed(value: float) -> str:
    """Return a difference with its sign; – if it is unknown or infinite."""
    if isnan(value) or isinf(value):
        return UNKNOWN
    return ("" if (text := decimal(value)).startswith("−") else "+") + text


def significant(value: float, digits: int = 3) -> str:
    """Return a number of unknown magnitude with its first digits."""
    return UNKNOWN if isnan(value) else f"{value + 0.0:.{digits}g}".replace("-", "−").replace("inf", "∞")


def percent(share: float, decimals: int = 1) -> str:
    """Return a share in percent, rounded to 0% or 100% only if it is: <0.1% of a few, >99.9% of nearly all."""
    if isnan(share) or isinf(share):
        return UNKNOWN
    text, step = f"{share:z.{decimals}%}", 10.0**-decimals
    if share != 0 and float(text[:-1]) == 0:
        return f"<{step:.{decimals}f}%"
    if share < 1 and float(text[:-1]) == 100:
        return f">{100 - step:.{decimals}f}%"
    return text


class Described(ABC):
    """An object with a few facts: one line in a terminal, a table in a notebook."""

    @property
    @abstractmethod
    def facts(self) -> Mapping[str, str]:
        """The facts to show, by name."""

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}: {fact}' for name, fact in self.facts.items())})"

    def _repr_html_(self) -> str:
        rows = (f"<tr><th>{escape(name)}</th><td>{escape(fact)}</td></tr>" for name, fact in self.facts.items())
        return f"<table><caption>{type(self).__name__}</caption>{''.join(rows)}</table>"
