"""Whether a mark is present in a model, from what a detector reads in its renders: bits, or a score.

The detector is the key of a scheme that hides bits, or a command of the user's.
"""

from __future__ import annotations

import json
import math
import os
import reprlib
import shlex
import signal
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from math import comb
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from gspure.arrays import Bools, Float32
from gspure.errors import InputError
from gspure.images import read_image
from gspure.metrics.csv_tables import read_table
from gspure.metrics.names import CLEAN
from gspure.metrics.retrieval import CHANCE, FALSE_POSITIVES, png_files

DETECTIONS: Final = "detections"  # name of the folder of readings: `SCHEME/SCENE/VARIANT/detections/DETECTOR.csv`
STRICT: Final = 0.001  # false positive rate of `Detection.tpr_strict`
LARGEST: Final = 1e100  # the largest score, of which squares are finite


class Reading(NamedTuple):
    """What a detector reads from one view."""

    view: str
    level: float  # share of correct bits in percent, or the score
    bits: int  # number of bits; 0 for a score

    @property
    def value(self) -> float:
        """The number of correct bits, or the score."""
        return round(self.level * self.bits / 100) if self.bits else self.level


class Detection(NamedTuple):
    """The readings of one detector over the views of a model."""

    level: float  # mean over views
    spread: float  # standard deviation over views
    tpr: float  # share of the views above the threshold that `FALSE_POSITIVES` of unmarked views exceed; NaN if unknown
    tpr_strict: float  # the same for `STRICT`
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


def read_detections(model: Path) -> dict[str, dict[str, Detection]]:
    """Return the detections of every variant in the folder of a model, by detector.

    Scores are compared with those of the views of the same model's clean control alone, by the same detector.
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


def read_marks(command: str, images: Path, message: str, timeout: float, folder: Path | None = None) -> list[Reading]:
    """Return what a command, run in a `folder`, reads from each PNG file of another, within `timeout` seconds.

    The command gets the folder as its last argument. The last line that it prints is a JSON object that maps the name
    of each image, without ``.png``, to bits, as a text of 0 and 1, or to a score, which is high if the mark is present.
    `message` holds the embedded bits, and is empty if the command returns scores.

    Raise `InputError` if the command cannot be run, fails, takes too long or prints anything else.
    """
    views, answer = {file.stem for file in png_files(images)}, _answer(command, images, timeout, folder)
    for view in sorted(views.symmetric_difference(answer)):
        found = "no entry" if view in views else "an entry without an image"
        raise InputError("detector", view, expected="an entry for every image", found=found)
    return [_reading(view, answer[view], message) for view in sorted(views)]


def read_bits(read: Callable[[Float32], Bools], message: Bools, images: Path) -> list[Reading]:
    """Return what a key reads from each PNG file of a folder, compared with the embedded `message`."""
    shown = {path.stem: as_bits(read(read_image(path)), len(message)) for path in png_files(images)}
    return [Reading(view, share_correct(bits, message), len(message)) for view, bits in shown.items()]


def output_of(source: str | Path, field: str, words: Sequence[str], timeout: float, folder: Path | None = None) -> str:
    """Return what a program prints, run in a `folder`; if it takes too long, end all that it started.

    Raise `InputError` for the `field` of a source if it cannot be run, fails or takes more than `timeout` seconds.
    """
    try:
        status, output, errors = _run(words, timeout, folder)
    except subprocess.TimeoutExpired:
        raise InputError(source, field, expected=f"an answer within {timeout:g} s", found="none") from None
    except OSError as error:
        raise InputError(source, field, expected="a command", found=str(error.strerror)) from None
    if status:
        found = errors.strip().rpartition("\n")[2] or f"exit status {status}"
        raise InputError(source, field, expected="success", found=found)
    return output


def words_of(command: str, source: str | Path = "detector") -> list[str]:
    """Return the words of a command, split as a shell does, or raise `InputError`."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise InputError(source, command, expected="a command", found=str(error)) from None
    if not words:
        raise InputError(source, "command", expected="a program and its options", found="nothing")
    return words


def files_of(command: str, source: str | Path = "detector") -> list[str]:
    """Return the files that a command names, as words or as ``--option=FILE``."""
    names = (name for word in words_of(command, source) for name in (word, word.partition("=")[2]))
    return [name for name in names if os.path.isfile(name)]  # noqa: PTH113 -- words may be too long for Path


def _answer(command: str, images: Path, timeout: float, folder: Path | None) -> Mapping[str, Any]:
    """Return what a command prints in its last line, a JSON object."""
    words = [*words_of(command), str(images)]
    output = output_of("detector", command, words, timeout, folder).strip().rpartition("\n")[2]
    try:
        answer = json.loads(output)
    except (ValueError, RecursionError):
        answer = None
    if not isinstance(answer, dict):
        raise InputError("detector", "output", expected="a JSON object in the last line", found=output or "nothing")
    return answer


def _run(words: Sequence[str], timeout: float, folder: Path | None) -> tuple[int, str, str]:
    streams: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(words, **streams, cwd=folder, start_new_session=True, text=True, errors="replace") as process:
        try:
            output, errors = process.communicate(timeout=timeout)
        except BaseException:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            raise
    return process.returncode, output, errors


def _reading(view: str, value: object, message: str) -> Reading:
    if message:
        if not isinstance(value, str) or len(value) != len(message) or {*value} - {*"01"}:
            raise InputError("detector", view, expected=f"{len(message)} bits as text", found=repr(value))
        decoded, truth = (np.array([*bits]) == "1" for bits in (value, message))
        return Reading(view, share_correct(decoded, truth), len(message))
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        hint = "if the detector returns bits, set `message` to the embedded bits" if isinstance(value, str) else None
        raise InputError(
            "detector", view, expected=f"a score within ±{LARGEST:g}", found=reprlib.repr(value), hint=hint
        )
    return Reading(view, float(value), 0)
