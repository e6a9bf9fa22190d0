"""Phrases for numbers with their spread, rounded to what a few scenes support."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from gspure.evaluation.statistics import LEVEL, Interval

MINUS: Final = "\N{MINUS SIGN}"

_NAMED: Final = 12
"""How many things a sentence names."""


def plural(count: int, noun: str) -> str:
    """Return a count with its noun."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def listed(names: Iterable[str]) -> str:
    """Return names with commas and an "and"; of very many, the first."""
    every = list(names)
    rest = len(every) - _NAMED
    shown = [*every[:_NAMED], f"{rest} more"] if rest > 0 else every
    between, last = ("; ", "; and ") if any("," in name for name in shown) else (", ", " and ")
    return last.join([between.join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)


def tenths(value: float) -> str:
    """Return a number with one decimal and a true minus."""
    return f"{value:.1f}".replace("-0.0", "0.0").replace("-", MINUS)


def spread(interval: Interval) -> str:
    """Return the ends of an interval, in parentheses; of one scene there is none."""
    return f" ({tenths(interval.low)} to {tenths(interval.high)})" if interval.scenes > 1 else ""


def db(interval: Interval) -> str:
    """Return a mean in dB with its spread."""
    return f"{tenths(interval.mean)} dB{spread(interval)}"


def loses(drop: Interval) -> str:
    """Return what a drop means: "loses 1.2 dB (0.3 to 2.0)", or "gains" where it is negative."""
    return f"loses {db(drop)}" if drop.mean >= 0 else f"gains {db(mirrored(drop))}"


def mirrored(interval: Interval) -> Interval:
    """Return the interval of the negative."""
    return interval._replace(mean=-interval.mean, low=-interval.high, high=-interval.low)


def is_sure(difference: Interval) -> bool:
    """Whether a difference has the same sign wherever it was looked at; a single scene says nothing of others."""
    return difference.scenes > 1 and (difference.low > 0 or difference.high < 0)


def how_sure(difference: Interval) -> str:
    """Return in words whether a difference is one of all scenes."""
    if difference.scenes == 1:
        return "in the one scene"
    if difference.level >= LEVEL:
        return "reliably" if is_sure(difference) else "not reliably"
    return "in every scene" if is_sure(difference) else "not in every scene"
