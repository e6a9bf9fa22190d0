"""Whether a mark is present in a model: the statistics of a detector's readings from its renders."""

from __future__ import annotations

import math
from collections.abc import Sequence
from math import comb
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gspure.errors import InputError
from gspure.metrics.csv_tables import read_table
from gspure.metrics.names import CLEAN
from gspure.metrics.readings import Reading

FALSE_POSITIVES: Final = 0.01  # rate of unmarked views above the threshold of `Detection.tpr`
DETECTIONS: Final = "detections"  # name of the folder of readings: `SCHEME/SCENE/VARIANT/detections/DETECTOR.csv`
STRICT: Final = 0.001  # false positive rate of `Detection.tpr_strict`


class Detection(NamedTuple):
    """The readings of one detector over the views of a model."""

    level: float  # mean over views
    spread: float  # standard deviation over views
    tpr: float  # share of the views above the threshold that `FALSE_POSITIVES` of unmarked views exceed; NaN if unknown
    tpr_strict: float  # the same for `STRICT`
    p: float  # probability that as many views, or more, exceed the threshold of `tpr` in a model without the mark
    least_p: float  # the same of all views: the smallest that can be shown
    views: int
    bits: int


class Threshold(NamedTuple):
    """A number of correct bits, or a score, that unmarked views exceed at a known rate."""

    value: float
    rate: float

    @classmethod
    def at_rate(cls, rate: float, bits: int, clean: Sequence[float] = ()) -> Threshold:
        """Return the lowest threshold that unmarked views exceed at most at this rate.

        For `bits`, it follows from the binomial distribution: each bit of an unmarked view is correct with probability
        1/2. For scores (0 bits), it is the score of one of N `clean` views. The k-th highest has the rate k / (N + 1).
        With few bits or views, the highest threshold is returned, and its rate may exceed `rate`.
        """
        from scipy.stats import binom

        if bits:
            correct = min(float(binom.isf(rate, bits, 0.5)), bits - 1)
            return cls(correct, float(binom.sf(correct, bits, 0.5)))
        if not clean:
            return cls(math.nan, 1.0)
        above = max(int(rate * (1 + len(clean))) - 1, 0)
        return cls(sorted(clean)[-1 - above], (1 + above) / (1 + len(clean)))


def detection(readings: Sequence[Reading], clean: Sequence[float]) -> Detection:
    """Return the detection of a model from its readings; `clean` holds the scores of the views of its clean model."""
    from scipy.stats import binom

    views = len(readings)
    bits = readings[0].bits
    levels = np.array([reading.level for reading in readings])
    values = np.array([reading.value for reading in readings])
    threshold = Threshold.at_rate(FALSE_POSITIVES, bits, clean)
    strict_threshold = Threshold.at_rate(STRICT, bits, clean)
    hits = int(np.count_nonzero(values > threshold.value))
    strict_hits = int(np.count_nonzero(values > strict_threshold.value))
    rank = round(threshold.rate * (1 + len(clean)))  # of the threshold among the clean scores

    def chance(hits: int) -> float:
        r"""Return the probability that this many views, or more, exceed the threshold in a model without the mark.

        For scores, with h of V views above the k-th highest of N clean ones, it is

        .. math:: p = \sum_{i \ge h} \binom{V}{i} \binom{N}{h + k - 1 - i} \Big/ \binom{N + V}{h + k - 1}.
        """
        if bits:
            return float(binom.sf(hits - 1, views, threshold.rate))
        above = hits + rank - 1
        ways = sum(comb(views, i) * comb(len(clean), above - i) for i in range(hits, above + 1))
        return ways / comb(views + len(clean), above)

    return Detection(
        level=float(levels.mean()),
        spread=float(levels.std()),
        tpr=hits / views if threshold.rate <= FALSE_POSITIVES else math.nan,
        tpr_strict=strict_hits / views if strict_threshold.rate <= STRICT else math.nan,
        p=chance(hits),
        least_p=chance(views),
        views=views,
        bits=bits,
    )


def read_detections(model: Path) -> dict[str, dict[str, Detection]]:
    """Return the detections of every variant in the folder of a model, by detector.

    Scores of a detector are compared with its scores in the views of the same model's clean control only.
    """
    tables = sorted(model.glob(f"*/{DETECTIONS}/*.csv"))
    readings = {(path.parent.parent.name, path.stem): read_table(path, Reading) for path in tables}
    by_variant: dict[str, dict[str, Detection]] = {}
    for (variant, detector), rows in readings.items():
        if not rows:
            table = model / variant / DETECTIONS / f"{detector}.csv"
            raise InputError(table, "rows", expected="at least one view", found="none")
        clean = [row.level for row in readings.get((CLEAN, detector), ())]
        by_variant.setdefault(variant, {})[detector] = detection(rows, clean)
    return by_variant
