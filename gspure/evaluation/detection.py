"""Whether a mark is present in a model, from what a detector reads in its renders: bits, or a score."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Sequence
from math import comb
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from gspure.artifacts import require_agreement, settings_of
from gspure.cameras.off_path import PREFIX
from gspure.errors import InputError
from gspure.evaluation.controls import CLEAN, CONTROLS
from gspure.evaluation.csv_tables import read_table
from gspure.evaluation.retrieval import CHANCE, FALSE_POSITIVES
from gspure.files import Bools
from gspure.images import SHOWN
from gspure.settings import Share

DETECTIONS: Final = "detections"  # name of the folder of readings: `SCHEME/SCENE/VARIANT/detections/DETECTOR.csv`
FILE: Final = "file "  # settings of readings: prefix of the files that the detector's command names, with their digests
KEY: Final = "key"  # settings of readings: the embedding of the key that read bits, or `wrong_key`
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
    tpr: Share  # share of the views above the threshold that `FALSE_POSITIVES` of unmarked views exceed; NaN if unknown
    tpr_strict: Share  # the same for `STRICT`
    present: bool | None  # whether more views are above that of `tpr` than chance explains; None if no number would be
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


def as_bits(read: object, count: int) -> Bools:
    """Return what a key has read from an image as bits [count]; raise `InputError` if it is anything else."""
    bits = read if isinstance(read, np.ndarray) else np.empty(0, object)
    if bits.shape != (count,) or bits.dtype.kind not in "biu" or not np.isin(bits, (0, 1)).all():
        values = reprlib.repr(bits.tolist())
        found = f"{bits.dtype} {list(bits.shape)}: {values}" if bits is read else type(read).__name__
        expected = f"an array of {count} bits, 0 or 1 each"
        raise InputError("key", "bits read from an image", expected=expected, found=found)
    return bits.astype(np.bool_)


def share_correct(decoded: Bools, message: Bools) -> float:
    """Return the share of correct bits in percent."""
    return 100.0 * float(np.mean(decoded == message))


def detection(readings: Sequence[Reading], clean: Sequence[float]) -> Detection:
    """Return the detection of a model from its readings; `clean` holds the scores of the views of its clean model."""
    from scipy.stats import binom

    levels, bits = np.array([reading.level for reading in readings]), readings[0].bits
    values = np.array([reading.value for reading in readings])
    loose, strict = (Threshold.of(bits, clean, rate) for rate in (FALSE_POSITIVES, STRICT))
    hits, strict_hits = (int(np.count_nonzero(values > threshold.value)) for threshold in (loose, strict))
    views, rank = len(levels), round(loose.rate * (1 + len(clean)))  # rank of the threshold among the clean scores

    def chance(hits: int) -> float:
        """Return the probability of as many views above the threshold, or more, in a model without the mark."""
        if bits:
            return float(binom.sf(hits - 1, views, loose.rate))
        above = hits + rank - 1
        ways = sum(comb(views, i) * comb(len(clean), above - i) for i in range(hits, above + 1))
        return ways / comb(views + len(clean), above)

    return Detection(
        float(levels.mean()),
        float(levels.std()),
        hits / views if loose.rate <= FALSE_POSITIVES else math.nan,
        strict_hits / views if strict.rate <= STRICT else math.nan,
        chance(hits) <= CHANCE if chance(views) <= CHANCE else None,
        views,
        bits,
    )


def read_detections(tables: Sequence[Path]) -> dict[tuple[str, str, str], dict[str, Detection]]:
    """Return the detections of every variant by detector, from the files of `gspure detect`.

    Scores are compared with those of the views of the same model's clean control alone, by the same detector.

    Raise `InputError` if readings are out of range, or cannot be compared with those of the model's other variants.
    """
    on_path = [(path, _on_path(path)) for path in tables]
    _require_comparable(on_path)
    readings = {(*variant_of(path), path.stem): rows for path, rows in on_path}
    by_variant: dict[tuple[str, str, str], dict[str, Detection]] = {}
    for (scheme, folder, variant, detector), rows in readings.items():
        clean = [row.level for row in readings.get((scheme, folder, CLEAN, detector), ())]
        by_variant.setdefault((scheme, folder, variant), {})[detector] = detection(rows, clean)
    return by_variant


def _on_path(table: Path) -> list[Reading]:
    """Return the readings of the views on the camera path, if they are possible."""
    rows = [row for row in read_table(table, Reading) if not row.view.startswith(PREFIX)]
    if not rows:
        raise InputError(table, "rows", expected="at least one view on the camera path", found="none")
    for row in rows:
        if not row.is_possible or row.bits != rows[0].bits:
            expected = f"0 to 100 % of {rows[0].bits} bits" if rows[0].bits else "a score"
            found = f"{row.level} % of {row.bits} bits" if row.bits else f"the score {row.level}"
            raise InputError(table, row.view, expected=expected, found=found)
    return rows


def _require_comparable(on_path: Sequence[tuple[Path, list[Reading]]]) -> None:
    """Raise `InputError` if a detector read other bits or views of a variant than of the model's other variants.

    Command and message must agree, too, as far as records tell, and the files that the command names over all models of
    a scheme. Controls may have views of their own.
    """
    first_of: dict[tuple[str, ...], tuple[Path, list[Reading]]] = {}
    first_with: dict[tuple[str, ...], Path] = {}
    for path, rows in sorted(on_path, key=lambda table: variant_of(table[0])[2] in CONTROLS):
        scheme, folder, variant = variant_of(path)
        first, expected = first_of.setdefault((scheme, folder, path.stem), (path, rows))
        same = "read all with the same detector"
        require_agreement(first, path, _detector_of(first), _detector_of(path), same)
        for name in (name for name in settings_of(path) if name.startswith(FILE)):
            other = first_with.setdefault((scheme, path.stem, name), path)
            require_agreement(other, path, {name: settings_of(other)[name]}, settings_of(path), same)
        if rows[0].bits != expected[0].bits:
            raise InputError(path, "bits", expected=f"{expected[0].bits}, as in {first}", found=str(rows[0].bits))
        if variant not in CONTROLS and (views := {row.view for row in rows} ^ {row.view for row in expected}):
            names = ", ".join(sorted(views)[:3])
            found = f"others; in only one of the tables: {names}"
            raise InputError(path, "views", expected=f"those in {first}", found=found)


def _detector_of(table: Path) -> dict[str, Any]:
    """Return the settings of readings, without what the images show, and the key."""
    return {name: value for name, value in settings_of(table).items() if not name.startswith(SHOWN) and name != KEY}


def variant_of(path: Path) -> tuple[str, str, str]:
    """Return scheme, folder and variant of a file of readings; for a symbolic link, of the link, not its target."""
    scheme, folder, variant, *_ = path.parent.resolve().parts[-4:]
    return scheme, folder, variant
