"""Whether a mark is present in a model, from what a detector reads in its renders: bits, or a score."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gspure.artifacts import recorded_inputs
from gspure.cameras.off_path import PREFIX
from gspure.dtypes import Bools
from gspure.errors import InputError
from gspure.evaluation.controls import MESSAGE_FREE
from gspure.evaluation.csv_tables import read_table
from gspure.evaluation.retrieval import CHANCE, FALSE_POSITIVES

DETECTIONS: Final = "detections"  # name of the folder of readings: `SCHEME/SCENE/VARIANT/detections/DETECTOR.csv`
STRICT: Final = 0.001  # false positive rate of `Detection.tpr_strict`
LARGEST: Final = 1e100  # the largest score, of which squares are finite

_MOST_BITS: Final = 1 << 31


class Reading(NamedTuple):
    """What a detector reads from one view."""

    view: str
    level: float  # share of correct bits in percent, or the score
    bits: int  # number of bits; 0 for a score

    @property
    def value(self) -> float:
        """The number of correct bits, or the score."""
        return round(self.level * self.bits / 100) if self.bits else self.level

    @property
    def is_possible(self) -> bool:
        """Whether a detector could have read this."""
        return 0 <= self.level <= 100 and 0 < self.bits < _MOST_BITS if self.bits else abs(self.level) <= LARGEST


class Detection(NamedTuple):
    """The readings of one detector over the views on the camera path."""

    level: float  # mean over views
    spread: float  # standard deviation over views
    tpr: float  # share of the views above the threshold that `FALSE_POSITIVES` of unmarked views exceed; NaN if unknown
    tpr_strict: float  # the same for `STRICT`
    present: bool | None  # whether more views are above that of `tpr` than chance explains (`CHANCE`); None if unknown
    views: int
    bits: int


class Threshold(NamedTuple):
    """A number of correct bits, or a score, that unmarked views exceed at a known rate."""

    value: float
    rate: float

    @classmethod
    def of(cls, bits: int, clean: Sequence[float], rate: float) -> Threshold:
        """Return the lowest threshold that unmarked views exceed at this rate or a lower one.

        For `bits`, it follows from the binomial distribution: each bit of an unmarked view is correct with probability
        1/2. For scores (0 bits), it is the score of one of N `clean` views. The k-th highest has the rate k / (N + 1).
        With few bits or views even the highest threshold that a view can exceed has a higher rate than `rate`.
        """
        from scipy.stats import binom

        if bits:
            correct = min(float(binom.isf(rate, bits, 0.5)), bits - 1)
            return cls(correct, float(binom.sf(correct, bits, 0.5)))
        if not clean:
            return cls(math.nan, 1.0)
        above = max(int(rate * (1 + len(clean))) - 1, 0)
        return cls(sorted(clean)[-1 - above], (1 + above) / (1 + len(clean)))


def share_correct(decoded: Bools, message: Bools) -> float:
    """Return the share of correct bits in percent."""
    return 100.0 * float(np.mean(decoded == message))


def detection(readings: Sequence[Reading], clean: Sequence[float]) -> Detection:
    """Return the detection of a model from its readings; `clean` holds the scores of views of unmarked models."""
    from scipy.stats import binom

    levels, bits = np.array([reading.level for reading in readings]), readings[0].bits
    values = np.array([reading.value for reading in readings])
    loose, strict = (Threshold.of(bits, clean, rate) for rate in (FALSE_POSITIVES, STRICT))
    hits, strict_hits = (int(np.count_nonzero(values > threshold.value)) for threshold in (loose, strict))
    return Detection(
        float(levels.mean()),
        float(levels.std()),
        hits / len(levels) if loose.rate <= FALSE_POSITIVES else math.nan,
        strict_hits / len(levels) if strict.rate <= STRICT else math.nan,
        bool(binom.sf(hits - 1, len(levels), loose.rate) <= CHANCE) if bits or clean else None,
        len(levels),
        bits,
    )


def read_detections(tables: Sequence[Path]) -> dict[tuple[str, str, str], dict[str, Detection]]:
    """Return the detections of every variant by detector, from the files of `gspure detect`.

    The unmarked views of a detector are those of all controls without a message. An image counts once, also if several
    models share it as a control.
    """
    readings, clean = {path: read_table(path, Reading) for path in tables}, dict[str, dict[str, float]]()
    for path, rows in readings.items():
        rows[:] = [row for row in rows if not row.view.startswith(PREFIX)]
        if not rows:
            raise InputError(path, "rows", expected="at least one view on the camera path", found="none")
        for row in rows:
            if not row.is_possible or row.bits != rows[0].bits:
                expected = f"a share of {rows[0].bits} bits in percent" if rows[0].bits else "a score"
                raise InputError(path, row.view, expected=expected, found=f"{row.level} of {row.bits} bits")
        if variant_of(path)[-1] in MESSAGE_FREE:
            images = {Path(image).stem: digest for image, digest in recorded_inputs(path).items()}
            known = {images.get(row.view, f"{row.view} of {path}"): row.level for row in rows}
            clean.setdefault(path.stem, {}).update(known)
    by_variant: dict[tuple[str, str, str], dict[str, Detection]] = {}
    for path, rows in readings.items():
        unmarked = [*clean.get(path.stem, {}).values()]
        by_variant.setdefault(variant_of(path), {})[path.stem] = detection(rows, unmarked)
    return by_variant


def variant_of(path: Path) -> tuple[str, str, str]:
    """Return scheme, folder and variant of a file of readings."""
    scheme, folder, variant, *_ = path.resolve().parts[-5:]
    return scheme, folder, variant
