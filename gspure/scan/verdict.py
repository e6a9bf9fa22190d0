"""The verdict about a model: thresholds beyond which at most 1 % of the calibration's clean files lie."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from gspure.arrays import Float32
from gspure.metrics.csv_tables import read_table
from gspure.model.gaussians import Gaussians
from gspure.scan.statistics import STATISTICS, Measured, Statistic, measure, never_drawn
from gspure.schemes.registry import recognized

LIKELY: Final = "hidden content likely"
NOTHING: Final = "nothing found"
UNLIKE: Final = "unlike the calibration models"

LIKENESS: Final = ("rows", "median_opacity")  # outside their ranges, some statistics do not count
TABLE: Final = Path(__file__).with_name("calibration.csv")  # written by experiments/scan.py


class Clean(NamedTuple):
    """A statistic of the clean files of the calibration."""

    statistic: str
    low: float  # 1 % quantile of the files in which it can be measured; of `LIKENESS`, the least
    median: float
    high: float  # 99 % quantile; of `LIKENESS`, the largest
    threshold: float  # a message is likely beyond it; all thresholds together have a false-positive rate of 1 %
    files: int
    models: int  # from which the files were made


@cache
def calibration() -> dict[str, Clean]:
    """Return the committed calibration by statistic."""
    return {row.statistic: row for row in read_table(TABLE, Clean)}


def is_flagged(statistic: Statistic, value: float, threshold: float) -> bool:
    """Return whether a value lies beyond a threshold, on the side of a message; false for NaN."""
    return bool(value > threshold if statistic.raised else value < threshold)


def flagged(values: Mapping[str, float], limits: Mapping[str, float]) -> list[str]:
    """Return the names of the statistics beyond their thresholds; statistics without a threshold do not count."""
    limited = [s for s in STATISTICS if s.name in limits.keys() & values]
    return [s.name for s in limited if is_flagged(s, values[s.name], limits[s.name])]


def likeness(model: Gaussians) -> dict[str, float]:
    """Return `LIKENESS` of K >= 1 Gaussians: their number, and the median opacity of those that are drawn, or 0.

    Other rows do not count, since the rows of a message would lower the median so far that none of them is tested.
    """
    drawn = model.opacities[~never_drawn(model)]
    values = (len(model), float(np.median(drawn)) if len(drawn) else 0.0)
    return dict(zip(LIKENESS, values, strict=True))


@dataclass(frozen=True)
class Verdict:
    """The verdict about a model, with the reasons, one sentence each."""

    word: str  # `LIKELY`, `NOTHING` or `UNLIKE`
    reasons: tuple[str, ...]
    measured: Measured
    limits: Mapping[str, float]  # thresholds of the statistics that count for this model

    def statistics(self) -> dict[str, dict[str, Any]]:
        """Return each statistic with its place among those of clean models, None where it cannot be measured."""
        records = {}
        for name, value in self.measured.values.items():
            record = calibration()[name]._asdict()
            record["value"] = None if np.isnan(value) else value
            record["threshold"] = self.limits.get(name)
            records[name] = record
        return records

    def lines(self) -> Iterator[str]:
        """Yield the statistics as aligned lines of text, after a header; nothing without any."""
        if not self.measured.values:
            return
        yield f"{'':<40}{'this file':>10}{'clean: 1st':>12}{'50th':>9}{'99th':>9}   flagged if"
        for statistic in STATISTICS:
            if statistic.name in self.measured.values:
                yield self._line(statistic)
        clean = calibration()[LIKENESS[0]]
        yield f"percentiles of {clean.files} clean files from {clean.models} models; -: unknown, or does not count"

    def _line(self, statistic: Statistic) -> str:
        value = self.measured.values[statistic.name]
        clean = calibration()[statistic.name]
        cells = [_text(statistic, number) for number in (value, clean.low, clean.median, clean.high)]
        condition = "-"
        mark = ""
        if statistic.name in self.limits:
            limit = self.limits[statistic.name]
            condition = f"{'above' if statistic.raised else 'below'} {_text(statistic, limit)}"
            mark = "  <--" if is_flagged(statistic, value, limit) else ""
        return "{:<40}{:>10}{:>12}{:>9}{:>9}   {}{}".format(statistic.meaning, *cells, condition, mark)


def _text(statistic: Statistic, value: float) -> str:
    if np.isnan(value):
        return "-"
    return f"{100 * value:.2f} %" if statistic.is_share else f"{value:.2f}"


def _limit(statistic: Statistic, limit: float) -> str:
    return f"{'at most' if statistic.raised else 'at least'} {_text(statistic, limit)}"


def judge(model: Gaussians, weights: Float32 | None = None) -> Verdict:
    """Return the verdict about K >= 1 rows and, if they are known, their weights [K] in the public views."""
    if model.has_anchors or model.sh_degree < 0:
        return _judge_without_colours(model)
    measured = measure(model, weights)
    properties = likeness(model)
    differences: dict[str, str] = {}
    limits = {}
    uncounted = {}
    for statistic in STATISTICS:
        threshold = calibration()[statistic.name].threshold
        deviations = _deviations(statistic, properties)
        if not deviations:
            limits[statistic.name] = threshold
        elif not np.isnan(measured.values.get(statistic.name, np.nan)):
            uncounted[statistic.name] = threshold
            differences |= deviations
    reasons = _flag_reasons(measured.values, limits)
    word = NOTHING
    if reasons:
        word = LIKELY
    elif differences:
        word = UNLIKE
    reasons += differences.values()
    reasons += [f"not counted: {reason}" for reason in _flag_reasons(measured.values, uncounted)]
    if np.isnan(measured.values["bit_entropy"]):
        reasons.append("the colours have too few values, as in compressed formats, or rows, to test their low bits")
    if np.isnan(measured.values["never_drawn"]):
        reasons.append("the opacities have too few values, as in compressed formats, to test what is never drawn")
    return Verdict(word, tuple(reasons), measured, limits)


def _judge_without_colours(model: Gaussians) -> Verdict:
    """Return the verdict about a model without spherical harmonics, whose statistics are not measured."""
    scheme = None
    if model.has_anchors:
        reason = "its rows are anchors: SecureGS publishes what Scaffold-GS does, and keeps the message's networks"
    else:
        scheme = recognized(model)
        reason = f"it stores features that only a network decodes, as {scheme.name} does" if scheme else "no colours"
    return Verdict(LIKELY if scheme else UNLIKE, (reason,), Measured({}, {}), {})


def _flag_reasons(values: Mapping[str, float], limits: Mapping[str, float]) -> list[str]:
    """Return a sentence for each statistic beyond its threshold."""
    names = flagged(values, limits)
    return [
        f"{s.meaning} {_text(s, values[s.name])}, {_limit(s, limits[s.name])} in clean models"
        for s in STATISTICS
        if s.name in names
    ]


def _deviations(statistic: Statistic, properties: Mapping[str, float]) -> dict[str, str]:
    """Return why a statistic does not count for a model of these properties, by their names."""
    below = [name for name in statistic.ranges.least if properties[name] < calibration()[name].low]
    above = [name for name in statistic.ranges.most if properties[name] > calibration()[name].high]
    return {name: _likeness_reason(name, properties[name]) for name in (*below, *above)}


def _likeness_reason(name: str, value: float) -> str:
    def shortened(number: float) -> str:
        return f"{number:,.3f}".rstrip("0").rstrip(".")

    low = shortened(calibration()[name].low)
    high = shortened(calibration()[name].high)
    limits = low if low == high else f"{low} to {high}"
    return f"{name.replace('_', ' ')} {shortened(value)}, where the calibration has {limits}"
