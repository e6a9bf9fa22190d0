"""Numbers and facts as text for people."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from decimal import ROUND_CEILING, Context
from html import escape
from math import isinf, isnan
from typing import Final

UNKNOWN: Final = "–"
_LONG: Final = 1e6  # numbers from here on have an exponent
_ROUNDED_UP: Final = Context(prec=2, rounding=ROUND_CEILING)


def decimal(value: float, decimals: int = 2) -> str:
    """Return a number with a fixed number of decimals and a true minus sign; zero has no sign, nan is –."""
    if isnan(value):
        return UNKNOWN
    if isinf(value):
        return "∞" if value > 0 else "−∞"
    notation = "f" if abs(value) < _LONG else "e"
    return f"{value:z.{decimals}{notation}}".replace("-", "−")


def signed(value: float) -> str:
    """Return a difference with its sign; – if it is unknown or infinite."""
    if isnan(value) or isinf(value):
        return UNKNOWN
    text = decimal(value)
    return text if text.startswith("−") else f"+{text}"


def significant(value: float, digits: int = 3) -> str:
    """Return a number of any magnitude with its first digits."""
    return UNKNOWN if isnan(value) else f"{value + 0.0:.{digits}g}".replace("-", "−").replace("inf", "∞")


def p_value(p: float) -> str:
    """Return a p-value with two digits, rounded up: it exceeds a level in print if it does."""
    return significant(float(_ROUNDED_UP.create_decimal(str(p))), 2)


def percent(share: float, decimals: int = 1) -> str:
    """Return a share in percent; only exact shares become 0% and 100%, those nearby <0.1% and >99.9%."""
    if isnan(share) or isinf(share):
        return UNKNOWN
    text = f"{share:z.{decimals}%}"
    step = 10.0**-decimals
    if share != 0 and float(text[:-1]) == 0:
        return f"<{step:.{decimals}f}%"
    if share < 1 and float(text[:-1]) == 100:
        return f">{100 - step:.{decimals}f}%"
    return text


class Described(ABC):
    """An object that shows a few facts: in one line in a terminal, as a table in a notebook."""

    @property
    @abstractmethod
    def facts(self) -> Mapping[str, str]:
        """The facts to show, by name."""

    def __repr__(self) -> str:
        facts = ", ".join(f"{name}: {fact}" for name, fact in self.facts.items())
        return f"{type(self).__name__}({facts})"

    def _repr_html_(self) -> str:
        rows = (f"<tr><th>{escape(name)}</th><td>{escape(fact)}</td></tr>" for name, fact in self.facts.items())
        return f"<table><caption>{type(self).__name__}</caption>{''.join(rows)}</table>"
