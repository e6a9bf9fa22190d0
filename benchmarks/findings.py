"""The findings of one benchmark: times of its variants, and figures with their goals."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.timing import Times


@dataclass(frozen=True)
class Figure:
    """A number, and the goal set for it, if any."""

    name: str
    value: float
    at_most: float | None = None
    at_least: float | None = None

    @property
    def goal(self) -> str:
        """The goal in words, and whether it is met."""
        if self.at_most is not None:
            return f"at most {self.at_most:g}: {'met' if self.value <= self.at_most else 'missed'}"
        if self.at_least is not None:
            return f"at least {self.at_least:g}: {'met' if self.value >= self.at_least else 'missed'}"
        return ""


@dataclass
class Findings:
    """The findings of one benchmark."""

    title: str
    times: dict[str, Times] = field(default_factory=dict)
    figures: list[Figure] = field(default_factory=list)

    def figure(self, name: str, value: float, *, at_most: float | None = None, at_least: float | None = None) -> None:
        """Add a number, and its goal if it has one."""
        self.figures.append(Figure(name, float(value), at_most, at_least))

    def summary(self) -> dict[str, Any]:
        """Return the findings for JSON, times in milliseconds."""
        return {
            "title": self.title,
            "times_ms": {name: _summary(times) for name, times in self.times.items()},
            "figures": [{"name": f.name, "value": f.value, "goal": f.goal} for f in self.figures],
        }

    def markdown(self) -> Iterator[str]:
        """Yield the lines of the tables."""
        yield f"## {self.title}"
        if self.times:
            yield from ("", "| | wall | least | CPU / cores | least | runs |", "|---|--:|--:|--:|--:|--:|")
            for name, times in self.times.items():
                yield f"| {name} | " + " | ".join(map(_readable, _summary(times).values())) + " |"
        if self.figures:
            yield from ("", "| | | goal |", "|---|--:|---|")
            for figure in self.figures:
                yield f"| {figure.name} | {_readable(figure.value)} | {figure.goal} |"
        yield ""


def _readable(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def _summary(times: Times) -> dict[str, float]:
    return {
        "wall_median": 1e3 * float(np.median(times.wall)),
        "wall_min": 1e3 * min(times.wall),
        "cpu_per_core_median": 1e3 * float(np.median(times.per_core)),
        "cpu_per_core_min": 1e3 * min(times.per_core),
        "runs": len(times.wall),
    }
